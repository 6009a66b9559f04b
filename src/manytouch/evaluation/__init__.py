"""How wrong is a method? Estimates against truth: metrics, the accuracy suite, the report.

    from manytouch.evaluation.records.folders import load_result, load_truth
    from manytouch.evaluation.metrics.comparison import compare, figures

    print(figures(compare(load_truth(truth_folder), load_result(result_folder)))["depth"])

`record` is the value that both sides become, from `folders` or from values in memory (`live`).
`matching` says who belongs to whom. `dots`, `depth`, `touches`, `separation`, `latency` and
`uncertainty` hold the metrics; each docstring defines its figures. `comparison` puts them together,
`suite` names the cases, `runner` runs them, `report` writes what came out.
"""
