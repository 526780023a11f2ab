// SPDX-License-Identifier: Apache-2.0
// asi_soc: core, memories, registers, time and host window: everything above the cycle sequencer.
module asi_soc #(
  parameter int unsigned ClkHz         = 16_000_000,  // whole multiple of 8 MHz
  parameter int unsigned RamWords      = 16384,       // program RAM in 32-bit words
  parameter bit          BootFromFlash = 1'b0,        // 0: start at RAM address 0; 1: start in the boot ROM
  parameter              FirmwareHex   = "",          // $readmemh of the RAM; in simulation +firmware=<file> wins
  parameter              BootRomHex    = ""           // $readmemh of the boot ROM
) (
  input  logic        clk_i, rst_i,                   // rst_i: synchronous, active high
  // native host port: request held until ready; a read's data is valid with ready
  input  logic        host_req_i, host_we_i,
  input  logic [13:2] host_addr_i,
  input  logic [3:0]  host_be_i,
  input  logic [31:0] host_wdata_i,
  output logic [31:0] host_rdata_o,
  output logic        host_ready_o, host_irq_o,
  // flash
  output logic        spi_sck_o, spi_cs_no, spi_mosi_o,
  input  logic        spi_miso_i,
  // engines: ports of the shared memories, word addresses, read data one clock after the request
  input  logic        stat_req_i, stat_we_i,
  input  logic [9:0]  stat_addr_i,
  input  logic [31:0] stat_wdata_i,
  output logic [31:0] stat_rdata_o,
  input  logic        ring_req_i, ring_we_i,
  input  logic [8:0]  ring_addr_i,
  input  logic [31:0] ring_wdata_i,
  // sequencer: link RAM port, control, state, events
  input  logic        seq_req_i, seq_we_i,
  input  logic [7:0]  seq_addr_i,
  input  logic [31:0] seq_wdata_i,
  output logic [31:0] seq_rdata_o,
  output logic        tick_us_o,                      // pulse each microsecond
  output logic        line_en_o, cycle_en_o, two_extra_o, out_hold_o, read_id_o,
  output logic [12:0] min_cycle_us_o,
  output logic        batch_start_o,                  // pulse, batch_len_o is valid with it
  output logic [6:0]  batch_len_o,
  output logic [2:0]  exec_phase_o,
  input  logic        batch_busy_i, cycle_busy_i, apf_i, efault_i,
  input  logic        cycle_done_i, exchange_done_i, batch_done_i, slave_lost_i, jabber_i,  // pulses
  // monitor
  output logic        mon_enable_o, mon_clear_o,      // clear: pulse
  output logic [7:0]  mon_tail_o,
  input  logic [7:0]  mon_head_i,
  input  logic [15:0] mon_lost_i,
  output logic        core_wait_o                     // the core sleeps in WAIT
);
  localparam logic [31:0] ResetVector = BootFromFlash ? 32'h1000_0000 : 32'h0000_0000;
  localparam int unsigned RamW        = $clog2(RamWords);
  localparam int unsigned UsClocks    = ClkHz / 1_000_000;
  localparam int unsigned UsW         = $clog2(UsClocks);
  localparam logic [5:0]  WaitOffset  = 6'h24;        // WAIT in rdl/asi.rdl

  // ---------------------------------------------------------------- core and buses
  logic            ireq, iready, dreq, dwe, dready, irq;
  logic [31:2]     iaddr, daddr;
  logic [31:0]     irdata, drdata, dwdata;
  logic [3:0]      dbe;
  logic            ram_req, ram_we, rom_req, dpm_req, dpm_ready, link_req, link_ready, regs_req, regs_ready;
  logic            stat_req, stat_ready, ring_req, ring_ready;
  logic [RamW-1:0] ram_addr;
  logic [31:0]     ram_rdata, rom_rdata, dpm_rdata, regs_rdata, ring_rdata;

  asi_core #(.ResetVector(ResetVector)) u_core (
    .clk_i, .rst_i, .irq_i(irq),
    .ibus_req_o(ireq), .ibus_addr_o(iaddr), .ibus_rdata_i(irdata), .ibus_ready_i(iready),
    .dbus_req_o(dreq), .dbus_we_o(dwe), .dbus_be_o(dbe), .dbus_addr_o(daddr), .dbus_wdata_o(dwdata),
    .dbus_rdata_i(drdata), .dbus_ready_i(dready)
  );

  asi_fabric #(.RamWords(RamWords), .BootFromFlash(BootFromFlash)) u_fabric (
    .clk_i, .rst_i,
    .ibus_req_i(ireq), .ibus_addr_i(iaddr), .ibus_rdata_o(irdata), .ibus_ready_o(iready),
    .dbus_req_i(dreq), .dbus_we_i(dwe), .dbus_addr_i(daddr), .dbus_rdata_o(drdata), .dbus_ready_o(dready),
    .ram_req_o(ram_req), .ram_we_o(ram_we), .ram_addr_o(ram_addr), .rom_req_o(rom_req),
    .ram_rdata_i(ram_rdata), .rom_rdata_i(rom_rdata),
    .dpm_req_o(dpm_req), .link_req_o(link_req), .stat_req_o(stat_req), .ring_req_o(ring_req), .regs_req_o(regs_req),
    .dpm_rdata_i(dpm_rdata), .link_rdata_i(seq_rdata_o), .stat_rdata_i(stat_rdata_o), .ring_rdata_i(ring_rdata),
    .regs_rdata_i(regs_rdata),
    .dpm_ready_i(dpm_ready), .link_ready_i(link_ready), .stat_ready_i(stat_ready), .ring_ready_i(ring_ready),
    .regs_ready_i(regs_ready)
  );

  asi_ram #(.Words(RamWords), .InitFile(FirmwareHex), .InitPlusarg("firmware")) u_ram (
    .clk_i, .req_i(ram_req), .we_i(ram_we), .be_i(dbe), .addr_i(ram_addr), .wdata_i(dwdata), .rdata_o(ram_rdata)
  );

  generate
    if (BootFromFlash) begin : g_rom
      asi_boot_rom #(.InitFile(BootRomHex)) u_rom (
        .clk_i, .req_i(rom_req), .addr_i(ram_addr[7:0]), .rdata_o(rom_rdata)
      );
    end else begin : g_no_rom
      logic unused;
      assign unused    = rom_req;
      assign rom_rdata = '0;
    end
  endgenerate

  asi_shared_mem #(.Words(256)) u_link_mem (
    .clk_i, .rst_i,
    .core_req_i(link_req), .core_we_i(dwe), .core_clear_i(1'b0), .core_be_i(dbe), .core_addr_i(daddr[9:2]),
    .core_wdata_i(dwdata), .core_ready_o(link_ready),
    .eng_req_i(seq_req_i), .eng_we_i(seq_we_i), .eng_addr_i(seq_addr_i), .eng_wdata_i(seq_wdata_i),
    .rdata_o(seq_rdata_o)
  );
  asi_shared_mem #(.Words(1024)) u_stat_mem (         // bit 12: reads clear the word
    .clk_i, .rst_i,
    .core_req_i(stat_req), .core_we_i(dwe), .core_clear_i(daddr[12]), .core_be_i(dbe), .core_addr_i(daddr[11:2]),
    .core_wdata_i(dwdata), .core_ready_o(stat_ready),
    .eng_req_i(stat_req_i), .eng_we_i(stat_we_i), .eng_addr_i(stat_addr_i), .eng_wdata_i(stat_wdata_i),
    .rdata_o(stat_rdata_o)
  );
  asi_shared_mem #(.Words(512)) u_ring_mem (
    .clk_i, .rst_i,
    .core_req_i(ring_req), .core_we_i(dwe), .core_clear_i(1'b0), .core_be_i(dbe), .core_addr_i(daddr[10:2]),
    .core_wdata_i(dwdata), .core_ready_o(ring_ready),
    .eng_req_i(ring_req_i), .eng_we_i(ring_we_i), .eng_addr_i(ring_addr_i), .eng_wdata_i(ring_wdata_i),
    .rdata_o(ring_rdata)
  );

  // ---------------------------------------------------------------- host window
  logic host_attn;
  asi_regs_pkg::asi_regs__in_t  hw_in;
  asi_regs_pkg::asi_regs__out_t hw_out;

  asi_dpm u_dpm (
    .clk_i, .rst_i,
    .core_req_i(dpm_req), .core_we_i(dwe), .core_be_i(dbe), .core_addr_i(daddr[13:2]), .core_wdata_i(dwdata),
    .core_rdata_o(dpm_rdata), .core_ready_o(dpm_ready),
    .host_req_i, .host_we_i, .host_be_i, .host_addr_i, .host_wdata_i, .host_rdata_o, .host_ready_o,
    .irq_set_i(hw_out.HOST_IRQ.set.value), .host_irq_o, .host_attn_o(host_attn)
  );

  // ---------------------------------------------------------------- time
  logic [UsW-1:0] us_cnt_q;
  logic [31:0]    time_q;
  logic           apf_q, efault_q;
  always_ff @(posedge clk_i) begin
    tick_us_o <= !rst_i && us_cnt_q == UsW'(UsClocks - 1);
    us_cnt_q  <= (rst_i || us_cnt_q == UsW'(UsClocks - 1)) ? '0 : us_cnt_q + 1'b1;
    time_q    <= rst_i ? '0 : time_q + 32'(tick_us_o);
    {apf_q, efault_q} <= {apf_i, efault_i};          // no event for the state that reset leaves
  end

  // ---------------------------------------------------------------- registers
  logic [7:0]  pending;
  logic        regs_go, is_wait, spi_shift, spi_busy, rd_ack, wr_ack, rd_err, wr_err, stall_rd, stall_wr;
  logic [7:0]  spi_next;

  assign is_wait     = regs_req & ~dwe & (daddr[5:2] == WaitOffset[5:2]);
  assign core_wait_o = is_wait & (pending == '0);
  assign regs_ready  = ~core_wait_o;
  assign regs_go     = regs_req & regs_ready;
  assign irq         = pending != '0;
  // registered: what the core reads in WAIT does not hang on its own request in the same clock
  always_ff @(posedge clk_i)
    pending <= {8{~rst_i}} & hw_out.EVENT_EN.mask.value &
               {hw_out.EVENT.exchange_done.value, hw_out.EVENT.efault_change.value, hw_out.EVENT.host_attn.value,
                hw_out.EVENT.tick.value, hw_out.EVENT.apf_change.value, hw_out.EVENT.slave_lost.value,
                hw_out.EVENT.batch_done.value, hw_out.EVENT.cycle_done.value};

  always_comb begin
    hw_in.STATUS.batch_busy.next    = batch_busy_i;
    hw_in.STATUS.cycle_busy.next    = cycle_busy_i;
    hw_in.STATUS.apf.next           = apf_i;
    hw_in.STATUS.efault.next        = efault_i;
    hw_in.EVENT.cycle_done.hwset    = cycle_done_i;
    hw_in.EVENT.batch_done.hwset    = batch_done_i;
    hw_in.EVENT.slave_lost.hwset    = slave_lost_i;
    hw_in.EVENT.apf_change.hwset    = apf_i ^ apf_q;
    hw_in.EVENT.tick.hwset          = tick_us_o & (&time_q[9:0]);
    hw_in.EVENT.host_attn.hwset     = host_attn;
    hw_in.EVENT.efault_change.hwset = efault_i ^ efault_q;
    hw_in.EVENT.exchange_done.hwset = exchange_done_i;
    hw_in.LATCH.apf.hwset           = apf_i;
    hw_in.LATCH.efault.hwset        = efault_i;
    hw_in.LATCH.jabber.hwset        = jabber_i;
    hw_in.MONITOR.head.next         = mon_head_i;
    hw_in.MONITOR.lost.next         = mon_lost_i;
    hw_in.CLOCK.mhz.next            = 8'(UsClocks);
    hw_in.TIME.us.next              = time_q;
    hw_in.WAIT.pending.next         = pending;
    hw_in.SPI_DATA.data.next        = spi_next;
    hw_in.SPI_DATA.data.we          = spi_shift;
    hw_in.SPI_CTRL.busy.next        = spi_busy;
  end

  asi_regs u_regs (
    .clk(clk_i), .rst(rst_i),
    .s_cpuif_req(regs_go), .s_cpuif_req_is_wr(dwe), .s_cpuif_addr({daddr[5:2], 2'b00}), .s_cpuif_wr_data(dwdata),
    .s_cpuif_wr_biten({{8{dbe[3]}}, {8{dbe[2]}}, {8{dbe[1]}}, {8{dbe[0]}}}),
    .s_cpuif_req_stall_wr(stall_wr), .s_cpuif_req_stall_rd(stall_rd),
    .s_cpuif_rd_ack(rd_ack), .s_cpuif_rd_err(rd_err), .s_cpuif_rd_data(regs_rdata),
    .s_cpuif_wr_ack(wr_ack), .s_cpuif_wr_err(wr_err),
    .hwif_in(hw_in), .hwif_out(hw_out)
  );

  always_ff @(posedge clk_i) batch_start_o <= ~rst_i & hw_out.BATCH.len.swmod;   // the length is stored one clock later
  assign batch_len_o    = hw_out.BATCH.len.value;
  assign cycle_en_o     = hw_out.CTRL.cycle_en.value;
  assign two_extra_o    = hw_out.CTRL.two_extra.value;
  assign out_hold_o     = hw_out.CTRL.out_hold.value;
  assign read_id_o      = hw_out.CTRL.read_id.value;
  assign line_en_o      = hw_out.CTRL.line_en.value;
  assign min_cycle_us_o = hw_out.CTRL.min_cycle_us.value;
  assign exec_phase_o   = hw_out.EXEC.phase.value;
  assign mon_enable_o   = hw_out.MONITOR_CTRL.enable.value;
  assign mon_clear_o    = hw_out.MONITOR_CTRL.clear.value;
  assign mon_tail_o     = hw_out.MONITOR_CTRL.tail.value;

  // ---------------------------------------------------------------- flash
  asi_spi #(.ClkHz(ClkHz)) u_spi (
    .clk_i, .rst_i, .start_i(hw_out.SPI_DATA.data.swmod), .data_i(hw_out.SPI_DATA.data.value),
    .shift_o(spi_shift), .next_o(spi_next), .busy_o(spi_busy),
    .sck_o(spi_sck_o), .mosi_o(spi_mosi_o), .miso_i(spi_miso_i)
  );
  assign spi_cs_no = ~hw_out.SPI_CTRL.select.value;

`ifndef SYNTHESIS
  initial begin
    ClkHz_A: assert (ClkHz >= 8_000_000 && ClkHz % 8_000_000 == 0);
  end
  logic go_q;
  always_ff @(posedge clk_i) go_q <= !rst_i && regs_go;
  always_ff @(posedge clk_i) if (!rst_i) begin
    NoStall_A: assert (!(stall_rd || stall_wr || rd_err || wr_err));   // regs_ready relies on it
    Apart_A:   assert (!(regs_go && go_q));                                 // a cleared event is gone when WAIT is read
    Ack_A:     assert (regs_go == (rd_ack || wr_ack));
    Wait_C:    cover (core_wait_o);
  end
`else
  logic unused;
  assign unused = ^{rd_ack, wr_ack, rd_err, wr_err, stall_rd, stall_wr};
`endif
endmodule
