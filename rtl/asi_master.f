// SPDX-License-Identifier: Apache-2.0
// Sources of asi_master in compile order, for `verilator -F` and other tools that read file lists.
// The soft core comes from the package pythondata_cpu_vexriscv: add its verilog/VexRiscv_Min.v.
generated/asi_map_pkg.sv
generated/asi_regs_pkg.sv
phy/asi_timing_pkg.sv
phy/asi_sync.sv
phy/asi_pulse_filter.sv
phy/asi_tx.sv
phy/asi_rx.sv
phy/asi_xact.sv
phy/asi_tx_guard.sv
phy/asi_tx_shape.sv
phy/asi_vth.sv
phy/asi_line_guard.sv
link/asi_seq.sv
generated/asi_regs.sv
dpm/asi_dpm.sv
soc/asi_ram.sv
soc/asi_boot_rom.sv
soc/asi_link_mem.sv
soc/asi_core.sv
soc/asi_fabric.sv
soc/asi_spi.sv
soc/asi_soc.sv
soc/asi_trace.sv
asi_master.sv
