# SPDX-License-Identifier: Apache-2.0
"""Readable models of an AS-Interface line for tests: line, slaves, faults, cocotb adapter.

line, faults and slaves are pure Python (no simulator); chip binds them to a DUT. The checks and the passive monitor are
those of the telegram decoder: asi.checks, asi.monitor.
"""
