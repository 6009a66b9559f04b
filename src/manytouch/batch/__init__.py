"""`process` for many recordings: only what is missing or changed, on processes, a cluster, or in shards.

The results are the only state: a result folder with a `summary.json` that is complete and has the hash of
the request is done. How one recording is processed is in `manytouch.session`, not here.
"""
