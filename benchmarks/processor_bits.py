"""Which operations give the same bits on another processor: a digest of each, to compare between machines.

    python benchmarks/processor_bits.py > here.txt               # on one machine
    python benchmarks/processor_bits.py --against here.txt       # on another, or with STRUCTLEARN_BITS=native
    qemu-x86_64 -cpu Haswell .venv/bin/python benchmarks/processor_bits.py --against here.txt

Inputs are integers and their quotients, so that they are the same anywhere. The operations are those of the
libraries that the pipeline rests on, and some of its own compiled functions. Ends with code 1 if any differs.
Operations called `estimated` are expected to: no tensor of ours may go through them.
"""
# ruff: noqa: E402 - libraries load when they are pinned

import argparse
import hashlib
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from structlearn.core import processor

processor.pin()

import numpy as np
import scipy.fft
import scipy.linalg
import scipy.signal
import torch
from arm_motions import iiwa
from sklearn.decomposition import PCA

from structlearn.core import quaternion
from structlearn.networks.torch_settings import Adam, RootMeanSquarePropagation, square_root
from structlearn.primitives import kernels
from structlearn.rigid_body.inertia_parameters import (
    STRUCTURES,
    Structure,
    link_inertias,
    structure_gradient,
    structure_theta,
)
from structlearn.rigid_body.regressor import torque_regressor
from structlearn.segmentation.dtw import correspondences

Operation = Callable[[], object]
SIZES = (3, 17, 64, 200)
ELEMENTWISE = (
    "sin",
    "cos",
    "tan",
    "exp",
    "expm1",
    "log",
    "log1p",
    "sqrt",
    "tanh",
    "arctan",
    "arccos",
    "cbrt",
)
OF_TENSORS = (
    *(
        "sin",
        "cos",
        "exp",
        "expm1",
        "log1p",
        "tanh",
        "sigmoid",
        "erf",
        "rsqrt",
        "reciprocal",
        "sinc",
        "square",
    ),
    *("sinh", "cosh", "abs", "log2", "log10", "softplus"),
)
ESTIMATED = ("sqrt", "log", "atan", "tan", "acos", "asin")


def main() -> None:
    """Print digests, or those that differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--against", type=Path, help="digests that another machine printed")
    parser.add_argument("--only", default="", help="operations whose names contain a word")
    options = parser.parse_args()
    if found := processor.deviations():
        print(f"# {found}", file=sys.stderr)
    lines = options.against.read_text().splitlines() if options.against else []
    there = {line[18:]: line[:16] for line in lines}
    count, different = 0, []
    for name, operation in operations():
        if options.only in name:
            count, value = count + 1, digest(operation())
            if options.against is None or there.get(name) != value:
                print(f"{value}  {name}", flush=True)
                different.append(name)
    if options.against:
        print(f"{len(different)} of {count} operations differ")
        sys.exit(any("estimated" not in name for name in different))


def digest(result: object) -> str:
    """Of the bytes of one or several arrays or tensors."""
    parts = result if isinstance(result, tuple | list) else [result]
    arrays = [part.detach().numpy() if isinstance(part, torch.Tensor) else np.asarray(part) for part in parts]
    return hashlib.sha256(b"".join(np.ascontiguousarray(one).tobytes() for one in arrays)).hexdigest()[:16]


def numbers(*shape: int, seed: int = 1) -> np.ndarray:
    """Numbers between -1 and 1 without a pattern."""
    return np.random.default_rng(seed).integers(-(2**40), 2**40, shape) / 2**40


def operations() -> Iterator[tuple[str, Operation]]:
    """Names and operations."""
    for precision in (np.float64, np.float32):
        yield from of_numpy(precision)
        yield from of_torch(precision)
    yield from of_scipy()
    yield from of_ours()


def of_numpy(precision: type) -> Iterator[tuple[str, Operation]]:
    """Elementwise functions, sums, sorts and linear algebra."""
    name = f"numpy {precision.__name__}"
    values = numbers(1003).astype(precision)
    for function in ELEMENTWISE:
        inputs = np.abs(values) if function in ("log", "sqrt") else values
        yield f"{name} {function}", partial(getattr(np, function), inputs)
    yield f"{name} power", lambda: np.abs(values) ** precision(1.7)
    yield f"{name} hypot, arctan2", lambda: (np.hypot(values, values[::-1]), np.arctan2(values, values[::-1]))
    yield (
        f"{name} sums",
        lambda: (values.sum(), values.mean(), values.std(), np.cumsum(values), values.prod()),
    )
    ties = np.round(4 * values)
    yield f"{name} sort", lambda: (np.sort(values), np.argsort(ties, kind="stable"))
    yield f"{name} median", lambda: (np.median(values), np.quantile(values, 0.3))
    yield f"{name} einsum", lambda: np.einsum("ij,jk->ik", *[values[:900].reshape(30, 30)] * 2)
    yield f"{name} fft", lambda: np.fft.rfft(values)
    for size in SIZES:
        square, other = numbers(size, size).astype(precision), numbers(size, size, seed=2).astype(precision)
        tall, definite = (
            numbers(2 * size, size).astype(precision),
            square @ square.T + np.eye(size, dtype=precision),
        )
        its = f"{name} {size}"
        yield f"{its} matmul", lambda a=square, b=other: (a @ b, a.T @ b, a @ b[0], a[0] @ b[0])
        yield f"{its} norm", lambda a=square: (np.linalg.norm(a), np.linalg.norm(a, axis=1))
        yield f"{its} solve", lambda a=square, b=other: np.linalg.solve(a, b)
        yield f"{its} inv, det", lambda a=square: (np.linalg.inv(a), *np.linalg.slogdet(a))
        yield f"{its} cholesky", lambda a=definite: np.linalg.cholesky(a)
        yield f"{its} eigh", lambda a=definite: np.linalg.eigh(a)
        yield f"{its} svd", lambda a=tall: np.linalg.svd(a)
        yield f"{its} qr", lambda a=tall: np.linalg.qr(a)
        yield f"{its} lstsq", lambda a=tall: np.linalg.lstsq(a, a[:, 0] ** 2, rcond=None)[0]


def of_scipy() -> Iterator[tuple[str, Operation]]:
    """What is in scipy's own BLAS and in its compiled code; principal components of scikit-learn."""
    for size in SIZES:
        square = numbers(size, size)
        definite = square @ square.T + np.eye(size)
        yield f"scipy {size} expm", lambda a=square: scipy.linalg.expm(a)
        yield (
            f"scipy {size} cho_solve",
            lambda a=definite: scipy.linalg.cho_solve(scipy.linalg.cho_factor(a), a[0]),
        )
        yield f"scipy {size} qr, svd", lambda a=square: (*scipy.linalg.qr(a), *scipy.linalg.svd(a))
        yield f"scipy {size} eigh", lambda a=definite: scipy.linalg.eigh(a)
    signal = numbers(1000)
    sections = scipy.signal.butter(4, 0.1, output="sos")
    yield "scipy filter", lambda: (sections, scipy.signal.sosfiltfilt(sections, signal))
    yield "scipy fft", lambda: scipy.fft.rfft(signal)
    yield "sklearn PCA", lambda: PCA(5, svd_solver="full").fit_transform(numbers(300, 20))


def of_torch(precision: type) -> Iterator[tuple[str, Operation]]:
    """Elementwise functions, products, and training steps."""
    name = f"torch {precision.__name__}"
    values = torch.from_numpy(numbers(1003).astype(precision))
    for function in (*OF_TENSORS, *ESTIMATED):
        inputs = values.abs() if function in ("sqrt", "log", "rsqrt", "log2", "log10") else values
        called = getattr(torch, function, None) or getattr(torch.nn.functional, function)
        label = f"{name} estimated {function}" if function in ESTIMATED else f"{name} {function}"
        yield label, lambda inputs=inputs, f=called: (f(inputs), f(inputs[::3]), f(inputs[:7].clone()))
    yield f"{name} estimated pow", lambda: values.abs() ** 0.5
    yield f"{name} pow", lambda: (values.abs() ** 1.7, values**2, values**3, (values.abs() + 1) ** -0.5)
    yield f"{name} square_root", lambda: square_root(values.abs() + 1e-30)
    yield (
        f"{name} hypot, atan2",
        lambda: (torch.hypot(values, values.flip(0)), torch.atan2(values, values.flip(0))),
    )
    table = values[:1000].view(10, 25, 4)
    yield f"{name} norm", lambda: [table.norm(dim=axis) for axis in range(3)]
    yield (
        f"{name} std, var",
        lambda: [f(table, dim=axis) for axis in range(3) for f in (torch.std, torch.var)],
    )
    yield f"{name} sums", lambda: [table.sum(axis) for axis in range(3)] + [table.mean(), table.cumsum(1)]
    yield f"{name} softmax", lambda: (table.softmax(1), table.logsumexp(1))
    for size in SIZES:
        stack = torch.from_numpy(numbers(4, size, size).astype(precision))
        definite = stack @ stack.mT + torch.eye(size, dtype=stack.dtype)
        its = f"{name} {size}"
        yield f"{its} matmul", lambda a=stack: (a @ a, a[0] @ a[1], a[0].T @ a[1], a[0] @ a[1, 0])
        yield (
            f"{its} baddbmm, einsum",
            lambda a=stack: (
                torch.baddbmm(a, a, a.mT, beta=2.0, alpha=0.5),
                torch.einsum("ei,ej,meb->mbij", a[0, :3, :3], a[1, :3, :3], a[:, :3]),
            ),
        )
        yield f"{its} solve", lambda a=stack: (torch.linalg.solve(a, a.mT), torch.linalg.inv(a))
        yield (
            f"{its} estimated cholesky, qr",
            lambda a=definite: (torch.linalg.cholesky(a), *torch.linalg.qr(a)),
        )
        yield f"{its} estimated eigh, svd", lambda a=definite: (*torch.linalg.eigh(a), *torch.linalg.svd(a))
        yield f"{its} estimated lstsq", lambda a=stack: torch.linalg.lstsq(a, a.mT).solution
        yield f"{its} Adam", lambda size=size, dtype=stack.dtype: trained(Adam, size, dtype)
        yield (
            f"{its} RMSProp",
            lambda size=size, dtype=stack.dtype: trained(RootMeanSquarePropagation, size, dtype),
        )


def trained(optimiser: type, size: int, dtype: torch.dtype) -> list[torch.Tensor]:
    """Weights of a network with batch normalisation after ten steps."""
    inputs = torch.from_numpy(numbers(50, size)).to(dtype)
    shapes = {"hidden": (32, size), "scale": (32,), "bias": (32,), "output": (2, 32)}
    weights = [
        torch.from_numpy(numbers(*shape, seed=3)).to(dtype).requires_grad_() for shape in shapes.values()
    ]
    steps = optimiser(weights, 1e-3, 0.99)
    for _ in range(10):
        hidden, scale, bias, output = weights
        values = torch.nn.functional.linear(inputs, hidden)
        values = torch.nn.functional.batch_norm(values, None, None, scale, bias, training=True).tanh()
        loss = (torch.nn.functional.linear(values, output) - inputs[:, :2]).square().mean()
        steps.step(torch.autograd.grad(loss, weights) if optimiser is Adam else loss)
    return weights


def of_ours() -> Iterator[tuple[str, Operation]]:
    """Compiled functions of the project, and what calls them."""
    rotations, curves = numbers(500, 3), np.cumsum(numbers(2, 300, 3, seed=4), axis=1)
    yield "ours quaternion", lambda: quaternion.rotation_vector(quaternion.from_rotation_vector(rotations))
    yield "ours features", lambda: kernels.features(np.abs(rotations[:, 0]), rotations[:, 1])
    yield "ours warping", lambda: correspondences(*curves)
    robot = iiwa(1)[0]
    motion = numbers(3, 100, len(robot.tree.names))
    yield "ours regressor", lambda: torque_regressor(robot.tree, *motion)
    free, friction, squared = numbers(4, 7, 10), numbers(4, 7, 2), np.array([True, False])
    slope = numbers(4, 7 * 12)
    for place, structure in list(enumerate(STRUCTURES))[1:]:
        its = (place, free, friction, squared)
        yield f"ours {structure}", lambda its=its: (structure_theta(*its), *structure_gradient(*its, slope))
        yield (
            f"ours {structure} by torch",
            lambda name=structure: differentiated(name, torch.from_numpy(free)),
        )


def differentiated(structure: Structure, free: torch.Tensor) -> list[torch.Tensor]:
    """Inertias for free parameters, and a gradient."""
    inertia = link_inertias(structure, free.requires_grad_()).inertia
    return [inertia, *torch.autograd.grad(inertia.square().sum(), free)]


if __name__ == "__main__":
    main()
