"""`python -m manytouch` is the command line."""

import sys

from manytouch.cli import main

sys.exit(main())
