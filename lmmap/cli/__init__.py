"""The ``lmmap`` command: `main` runs it, `arguments` defines its options, and the others do the work."""
