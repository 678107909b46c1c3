"""What a reader would build in place of the paper's pipeline, on the same images and training data.

`geometry` finds the port without learning.  `points` learns to mark points of the CAD, and PnP does the rest.
`regression` learns everything.  Each makes an object that is called like `lmmap.Estimator`: an image and its
time give an `Estimate`, with a confidence of its own.  `samples` are what they learn from, `train` is the
command that trains them by the loop that the pipeline's filters learn in, and `study` sets all side by side.
"""
