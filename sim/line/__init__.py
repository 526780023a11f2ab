# SPDX-License-Identifier: Apache-2.0
"""Analog model of the AS-i line: network, front end, the real receiver RTL behind it, and its margins.

    network     cable tree, loads, data decoupling -> voltage of one sender edge anywhere, exactly discretised
    front_end   band pass, noise, peak hold, comparators -> levels at the receiver's clock
    rtl         the Verilated receiver (tb/asi_line_rx.sv) in a shared library
    exchange    request and answer through line, repeaters and receivers
    margins     `make margins`: sweeps and Monte Carlo, docs/margins.md
    spice       the same networks in ngspice, and the stored reference waveforms
    capture     a short exchange as a voltage CSV for `python -m asi decode`

Units: SI (V, A, Ohm, H, F, s), cable length in m; times of pulses in ns, as everywhere in the project. Voltages are
deviations from the DC of the line. EK marks constants that are engineering knowledge, not from a public data sheet.
"""
