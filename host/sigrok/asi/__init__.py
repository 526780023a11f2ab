# SPDX-License-Identifier: Apache-2.0
'''
AS-Interface (AS-i, IEC 62026-2): telegrams between master and slaves.

Inputs are the two comparators of a receiver (one pulse per negative and per positive edge of the line voltage), or
one Manchester level, idle high. Shown are pulses, bits, requests with call name and address (5, 5A, 17B), answers
with their delay, and every error class of the receiver's checks. Sample rate: at least 2 MHz, better 4 MHz.
'''
import sys

if sys.version_info < (3, 10):
    raise ImportError("AS-Interface decoder: needs a sigrok with Python 3.10 or newer, this one has %d.%d"
                      % sys.version_info[:2])

from .pd import Decoder  # noqa: E402, F401
