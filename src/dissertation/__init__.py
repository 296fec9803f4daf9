"""The reproduction of the dissertation: simulated testbeds, public recordings and the evidence of both.

Its results are the same bits on every x86-64 processor with AVX2, so whatever imports it is pinned.
"""

from structlearn.core.processor import pin

pin()
