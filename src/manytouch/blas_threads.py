"""Limits BLAS to one thread.

Its matrices are small here, and on a busy machine its threads would wait for each other. Several threads also
sum in another order, so that results would depend on the number of cores.
"""

import os

VARIABLES = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


ONE_THREAD = dict.fromkeys(VARIABLES, "1")
"""Environment of a process whose BLAS has one thread."""


def request_one_blas_thread() -> None:
    """Request one thread of each BLAS that this process or a child of it loads later; imports nothing."""
    os.environ.update(ONE_THREAD)


def limit_blas_threads() -> None:
    """Limit each BLAS to one thread, those that are loaded already and those that are loaded later."""
    request_one_blas_thread()
    from threadpoolctl import threadpool_limits

    threadpool_limits(limits=1, user_api="blas")
