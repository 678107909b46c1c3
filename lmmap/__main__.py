"""``python -m lmmap`` is the ``lmmap`` command."""

import sys

from .cli.main import main

sys.exit(main())
