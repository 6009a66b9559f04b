"""Errors of a method: estimates against ground truth, the accuracy suite and its report.

    from manytouch.evaluation.evaluated_recordings.folders import load_result, load_truth
    from manytouch.evaluation.metrics.comparison import compare, figures

    print(figures(compare(load_truth(truth_folder), load_result(result_folder)))["depth"])

Inside are evaluated recordings (the value that estimates and ground truth become), metrics, the suite of
simulated cases, the report and the paper's own experiments. Not inside: simulation and the methods that are
evaluated.
"""
