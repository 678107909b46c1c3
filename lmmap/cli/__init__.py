"""The ``lmmap`` command: `main` has its words; the others do the work."""
