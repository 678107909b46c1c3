"""Batches of crops that worker processes make ahead."""

from __future__ import annotations

import mmap
import multiprocessing
from collections.abc import Iterator

import cv2
import numpy as np
import torch

from lmmap.pipeline.network import CHANNELS

from . import dataset
from .batches import make_batch
from .recipe import Recipe

AHEAD = 4  # batches that a worker makes before they are asked for


class Batches:
    """The batches of consecutive steps, made ahead by worker processes in turn.

    Inputs are in half precision: counts are exact in it, and frames finer than in training's bfloat16.
    """

    def __init__(self, samples: dataset.Samples, recipe: Recipe, first: int, workers: int):
        self._first, self._steps, size = first, recipe.steps, recipe.crop_px
        self._x = _shared((workers, AHEAD, recipe.batch, CHANNELS[recipe.modality], size, size), np.float16)
        self._y = _shared((workers, AHEAD, recipe.batch, 1, size, size), np.bool_)
        fork = multiprocessing.get_context("fork")  # before anything else computes: workers share the memory
        self._free = [fork.Semaphore(AHEAD) for _ in range(workers)]
        self._ready = [fork.Semaphore(0) for _ in range(workers)]
        self._processes = [fork.Process(target=self._work, args=(w, samples, recipe), daemon=True)
                           for w in range(workers)]  # fmt: skip
        for process in self._processes:
            process.start()

    def _work(self, worker: int, samples, recipe) -> None:
        torch.set_num_threads(1)
        cv2.setNumThreads(0)
        for k, step in enumerate(range(self._first + worker, self._steps, len(self._free))):
            x, y = make_batch(samples, recipe, step)
            self._free[worker].acquire()
            self._x[worker, k % AHEAD], self._y[worker, k % AHEAD] = x.numpy(), y.numpy()
            self._ready[worker].release()

    def __iter__(self) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
        for i in range(self._steps - self._first):
            k, worker = divmod(i, len(self._free))
            while not self._ready[worker].acquire(timeout=10):
                if not self._processes[worker].is_alive():
                    raise RuntimeError(f"the worker that makes step {self._first + i} has died")
            yield torch.from_numpy(self._x[worker, k % AHEAD]), torch.from_numpy(self._y[worker, k % AHEAD])
            self._free[worker].release()


def _shared(shape, dtype) -> np.ndarray:
    memory = mmap.mmap(-1, int(np.prod(shape)) * np.dtype(dtype).itemsize)
    return np.frombuffer(memory, dtype).reshape(shape)
