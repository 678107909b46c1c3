"""Pictures that belong to no recording: those of a folder, or those in a PDF."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lmmap.files import regular_file
from lmmap.recordings.images import decode, pictures_in, read_image
from lmmap.recordings.stream import input_errors
from lmmap.types import InputError
from lmmap_readers.depth import scaled

MAX_PDF_BYTES = 2**28
MAX_PICTURES = 1000
MIN_SIDE_PX = 100  # smaller ones are logos and letters


def pictures(path: Path) -> Iterator[tuple[str, np.ndarray]]:
    """``(name, image)`` of the pictures of a folder, in the order of their names, or of a PDF's pages.

    Raises
    ------
    InputError
        If there are none, if one cannot be read, or if pypdf is not installed and the path is a PDF.
    """
    path = Path(path)
    if path.is_dir():
        pictures = ((p.stem, _read(p)) for p in pictures_in(path))
    elif path.suffix.lower() == ".pdf":
        pictures = _pdf_pictures(path)
    else:
        raise InputError(f"{path}: neither a folder nor a .pdf; name one of these")
    seen = 0
    for seen, (name, image) in enumerate(pictures, 1):
        if seen > MAX_PICTURES:
            raise InputError(f"{path}: more than {MAX_PICTURES} pictures; give a part of them")
        yield name, image
    if not seen:
        raise InputError(f"{path}: holds no picture of {MIN_SIDE_PX} px or more; name another file")


def _read(path: Path) -> np.ndarray:
    try:
        return scaled(read_image(path))
    except ValueError as error:
        raise InputError(f"{path}: cannot read this picture ({error}); take it out of the folder") from None


def _pdf_pictures(path: Path) -> Iterator[tuple[str, np.ndarray]]:
    try:
        from pypdf import PdfReader
        from pypdf.errors import PyPdfError
    except ImportError:
        raise InputError(f"{path}: pypdf is not installed; pip install pypdf, or give a folder") from None
    damage = PyPdfError, NotImplementedError, LookupError, AttributeError, TypeError, RecursionError
    with input_errors(path, "not a PDF that can be read", "print it to a new file", damage):
        for number, page in enumerate(PdfReader(regular_file(path, MAX_PDF_BYTES)).pages, 1):
            for k, embedded in enumerate(page.images, 1):
                image = scaled(decode(embedded.data))
                if min(image.shape[:2]) >= MIN_SIDE_PX:
                    yield f"page{number}-{k}", image
