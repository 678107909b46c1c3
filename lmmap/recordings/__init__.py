"""Recordings as files: `formats` opens them, `stream` reads them piece by piece, and each format
has its own reader."""
