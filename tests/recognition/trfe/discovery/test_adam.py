"""Adam: torch's, to the bit, without its compiler."""

from __future__ import annotations

import subprocess
import sys
from copy import deepcopy

import torch
from torch import nn

from recognition.trfe.discovery.adam import Adam


def test_steps_are_those_of_torch() -> None:
    torch.manual_seed(0)
    ours = nn.Sequential(nn.Linear(5, 7), nn.GELU(), nn.Linear(7, 3))
    theirs, unused = deepcopy(ours), nn.Parameter(torch.ones(2))
    adam, reference = Adam([*ours.parameters(), unused], 1e-2), torch.optim.Adam(theirs.parameters(), lr=1e-2)
    for _ in range(25):
        inputs = torch.randn(11, 5)
        adam.step(ours(inputs).square().mean())
        reference.zero_grad()
        theirs(inputs).square().mean().backward()
        reference.step()
    for one, other in zip(ours.parameters(), theirs.parameters(), strict=True):
        assert torch.equal(one, other)
    assert torch.equal(unused, torch.ones(2))


def test_torchs_compiler_is_not_imported() -> None:
    program = """
import sys, torch
from recognition.trfe.discovery.adam import Adam
weight = torch.ones(2, requires_grad=True)
Adam([weight], 0.1).step(weight.sum())
sys.exit("torch._dynamo" in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0
