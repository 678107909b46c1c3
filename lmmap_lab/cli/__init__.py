"""The laboratory's subcommands of ``lmmap``, which finds them by their entry points."""
