"""A process that is forked from one that has estimated."""

import subprocess
import sys


def test_a_forked_process_does_not_wait_for_threads_that_it_has_not():
    forked = """
import os, torch
from lmmap.pipeline.crops import at_once
torch.set_num_threads(2)
at_once(int, int)
child = os.fork()
if not child:
    os._exit(at_once(int, int) != [0, 0])
assert os.waitpid(child, 0)[1] == 0
"""
    subprocess.run([sys.executable, "-W", "ignore", "-c", forked], check=True, timeout=60)
