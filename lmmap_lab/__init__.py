"""lmmap_lab: the laboratory of the book.  It simulates, trains, measures and draws; `lmmap` estimates."""
