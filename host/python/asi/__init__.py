# SPDX-License-Identifier: Apache-2.0
"""Tools around the open AS-Interface master: plants, simulation, decoders, reports."""
