#!/bin/sh
# casadi 3.8.2: Callback.eval_buffer gets None in place of a memoryview for every argument whose sparsity has no entries, such as the parameters
# of a function without any, and for one that the caller of a FunctionBuffer never set, where it means zeros. A callback that copies its
# buffers works for all functions with parameters, and ends with "Error calling eval_buffer" for the first one without.
# Seen: types ['memoryview', 'NoneType'] for arguments of two and of no entries, ['NoneType', 'NoneType'] with nothing set.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" casadi==3.8.2 numpy==2.4.6
PYTHONPATH="$folder" python3 - <<'CODE'
import sys

import casadi as ca
import numpy as np

seen = []


class Doubled(ca.Callback):
    def __init__(self):
        ca.Callback.__init__(self)
        self.construct("doubled", {})

    def get_n_in(self):
        return 2

    def get_n_out(self):
        return 1

    def get_sparsity_in(self, number):
        return ca.Sparsity.dense(2, 1) if number == 0 else ca.Sparsity.dense(0, 1)

    def get_sparsity_out(self, number):
        return ca.Sparsity.dense(2, 1)

    def has_eval_buffer(self):
        return True

    def eval_buffer(self, given, results):
        seen.append([type(each).__name__ for each in given])
        np.frombuffer(results[0])[:] = 0.0 if given[0] is None else 2.0 * np.frombuffer(given[0])
        return 0


doubled = Doubled()
value = doubled(ca.DM([1.0, 2.0]), ca.DM(0, 1))
buffer, run = doubled.buffer()
found = np.full(2, -1.0)
buffer.set_res(0, memoryview(found))
run()
print(f"casadi {ca.__version__}: arguments of two and of no entries are {seen[0]}, result {value}; nothing set: {seen[1]}, result {found}")
sys.exit(0 if seen == [["memoryview", "NoneType"], ["NoneType", "NoneType"]] and not found.any() else 1)
CODE
