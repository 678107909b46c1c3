"""What the book shows: drawings, tables, sliders, videos, and whether they are the committed ones."""
