"""The laboratory's words of the ``lmmap`` command, which finds them by their entry points."""
