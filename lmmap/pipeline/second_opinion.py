"""The name that programs written for 0.1 import; `Estimator` itself uses networks that learned a place."""

from .estimator import Estimator as estimator_of

__all__ = ["estimator_of"]
