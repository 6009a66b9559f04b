"""What runs the tasks of a batch: processes of this machine, a dask scheduler, SLURM jobs.

An engine gets tasks one by one and yields an outcome for each, once; what a task is, it does not know.
"""
