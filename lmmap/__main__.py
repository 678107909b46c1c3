"""``python -m lmmap`` is the ``lmmap`` command."""

import sys

from .cli import main

sys.exit(main())
