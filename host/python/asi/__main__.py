# SPDX-License-Identifier: Apache-2.0
"""python -m asi"""
from asi.cli import main

main()
