# SPDX-License-Identifier: GPL-3.0-or-later
"""Operations that the threads of a block share on a GPU. On a processor, and in plain Python, a block is one thread."""

from __future__ import annotations

THREADS, WARP = 128, 32
"""Threads of a block on a GPU: of one whose threads work alone, and of one that adds up the texels of an environment."""


def block_sum(value: float) -> float:
    """Return the sum of the values of all threads of a block: to each of them, added in the same order on every run."""
    return value


def wait_for_block() -> None:
    """Wait for the other threads of the block; what each of them has written is there for all afterwards."""


IN_CUDA = {
    block_sum: """
__shared__ decltype(value) sums[32];
for (int distance = 16; distance > 0; distance /= 2)
    value += __shfl_xor_sync(0xffffffff, value, distance);
if (blockDim.x > 32) {
    __syncthreads();  // all have read the last sum
    if (threadIdx.x % 32 == 0)
        sums[threadIdx.x / 32] = value;
    __syncthreads();
    value = sums[0];
    for (int i = 1; i < blockDim.x / 32; ++i)
        value += sums[i];
}
return value;""",
    wait_for_block: "__syncthreads();",
}
"""The bodies of these functions on a GPU: threads exchange values by warps, and warps in shared memory."""
