# SPDX-License-Identifier: Apache-2.0
"""Readable models of an AS-Interface line for tests: line, slaves, faults, passive monitor, cocotb adapter.

line, checks, faults, slaves and monitor are pure Python (no simulator); chip binds them to a DUT.
"""
