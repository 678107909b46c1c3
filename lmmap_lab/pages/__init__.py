"""What the book and the command show.

`drawings`, `tables` and `sliders` hold what several chapters use, and ``NAME_page`` what only the chapter of
that name uses.  `gallery` draws single images with their estimates, and `overlay` makes a video of them.
`beside_paper` sets the results on the authors' bags beside the paper's.  `reference` says whether results and
pages are the committed ones; read it last.
"""
