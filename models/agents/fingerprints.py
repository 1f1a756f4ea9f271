"""Hash a model's files, to detect that they have changed."""

import hashlib
from pathlib import Path

from models.agents.blackbox import is_foreign
from models.agents.model_paths import is_class, source_file, without_variant
from models.agents.onnx_weights import onnx_sha256
from models.agents.predictors import predictor_folder
from models.networks.checkpoint import SUMS
from overcooked.layout import Layout


def files_sha256(name: str, layout: Layout) -> str:
    """Return the hash of a model's files: an ONNX file, a class's source file, or a checkpoint's list of hashes; "" for
    what has no file (scripted models, addresses). Raises OSError, BlackBoxError."""
    base = without_variant(name)
    if is_class(base):
        path = source_file(base)
    elif is_foreign(base):
        return onnx_sha256(Path(base)) if base.endswith(".onnx") else ""
    else:
        path = predictor_folder(base, layout) / SUMS  # agents are found in the same places
    return hashlib.sha256(path.read_bytes()).hexdigest() if path is not None and path.is_file() else ""
