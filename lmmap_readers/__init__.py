"""Readers and writers of other programs' formats, one file each; lmmap finds them by the entry points of the
group `lmmap.readers`, and they can be used alone."""
