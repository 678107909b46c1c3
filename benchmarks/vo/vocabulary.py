"""Train the visual vocabulary that ORB-SLAM3 asks for, from ORB descriptors of seeded synthetic images.

vocabulary.py FILE

The stock vocabulary is a download of 139 MB from pictures whose licence is not stated; this one is made
here.  It is a tree of k-majority clusters (Galvez-Lopez and Tardos 2012) in DBoW2's text format: a line
``k L 0 0``, then for each node ``parent is_leaf 32 bytes weight``.  Distances are exact integers, so the
file is the same wherever OpenCV finds the same features.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

import cv2
import numpy as np

K, LEVELS, IMAGES, FEATURES, ROUNDS = 10, 5, 400, 1000, 8
SHA256 = "ef4bb44a9ae468c3179dec8d96e6d067c496bbef81664b14fc8e0cd94af53511"


def image(rng: np.random.Generator) -> np.ndarray:
    """Noise of several scales, polygons, lines and discs over it, 480 x 640, 8 bit."""
    picture = np.zeros((480, 640))
    for cells in (4, 8, 16, 32, 64, 128):
        coarse = rng.normal(size=(cells * 3 // 4, cells)).astype(np.float32)
        picture += cv2.resize(coarse, (640, 480), interpolation=cv2.INTER_CUBIC) / np.sqrt(cells)
    picture = np.clip(128 + 60 * picture / picture.std(), 0, 255).astype(np.uint8)
    for _ in range(rng.integers(20, 120)):
        shade, at = int(rng.integers(256)), rng.integers([-20, -20], [660, 500])
        size = float(rng.lognormal(3.2, 0.8))
        kind = rng.integers(3)
        if kind == 0:
            corners = at + rng.normal(0, size, (int(rng.integers(3, 7)), 2))
            cv2.fillPoly(picture, [corners.astype(np.int32)], shade)
        elif kind == 1:
            end = at + rng.normal(0, 3 * size, 2)
            cv2.line(picture, at.tolist(), end.astype(int).tolist(), shade, int(rng.integers(1, 4)))
        else:
            cv2.circle(picture, at.tolist(), max(int(size / 2), 1), shade, -1)
    return cv2.GaussianBlur(picture, (0, 0), float(rng.uniform(0.5, 1.2)))


def clusters(bits: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Label in 0..K-1 of each descriptor, bits (N, 256) as +-1 in float32."""
    centres = bits[rng.choice(len(bits), K, replace=False)]
    labels = None
    for _ in range(ROUNDS):
        new = np.argmax(bits @ centres.T, 1)  # +-1 products: largest where the fewest bits differ
        if labels is not None and np.array_equal(new, labels):
            break
        labels = new
        sums = np.stack([bits[labels == k].sum(0) for k in range(K)])
        centres = np.where(sums >= 0, 1, -1).astype(np.float32)
    return labels


def main(path: str) -> None:
    cv2.setRNGSeed(0)
    cv2.setNumThreads(1)
    rng = np.random.default_rng(20)
    orb = cv2.ORB_create(FEATURES, 1.2, 8, fastThreshold=10)
    found = [orb.detectAndCompute(image(rng), None)[1] for _ in range(IMAGES)]
    of_image = np.repeat(np.arange(IMAGES), [len(d) for d in found])
    packed = np.concatenate(found)
    bits = np.unpackbits(packed, axis=1).astype(np.float32) * 2 - 1
    lines, words, queue = [f"{K} {LEVELS} 0 0"], 0, [(0, 0, np.arange(len(bits)))]
    for parent, level, members in queue:  # the queue grows while it is walked: breadth first
        labels = clusters(bits[members], rng)
        for k in np.unique(labels):
            inside = members[labels == k]
            median = np.packbits(bits[inside].sum(0) >= 0)
            leaf = level + 1 == LEVELS or len(inside) <= K
            weight = np.log(IMAGES / len(np.unique(of_image[inside]))) if leaf else 0.0
            lines.append(f"{parent} {int(leaf)} {' '.join(map(str, median))} {weight:.6f}")
            words += leaf
            if not leaf:
                queue.append((len(lines) - 1, level + 1, inside))
    text = "\n".join(lines) + "\n"
    Path(path).write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    print(f"{path}: {words} words of {len(bits)} descriptors, sha256 {digest}")
    if digest != SHA256:
        print(f"{path}: not the vocabulary of the committed runs, whose sha256 is {SHA256}", file=sys.stderr)


if __name__ == "__main__":
    main(sys.argv[1])
