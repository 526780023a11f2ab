// SPDX-License-Identifier: Apache-2.0
// asi_master: the chip. Line pins on one side, host port on the other, a flash for the firmware if wanted.
// Contract and memory map: docs/architecture.md. Registers and host window: rdl/asi.rdl.
module asi_master #(
  parameter int unsigned ClkHz         = 16_000_000,  // whole multiple of 8 MHz
  parameter              FirmwareHex   = "",          // $readmemh of the RAM; in simulation +firmware=<file> wins
  parameter              BootRomHex    = "",          // $readmemh of the boot ROM
  parameter bit          BootFromFlash = 1'b0,        // 0: start at RAM address 0; 1: start in the boot ROM
  parameter int unsigned RamWords      = 16384,       // program RAM in 32-bit words, a power of two, 4096..16384
  parameter bit          ReadBack      = 1'b1,        // own requests must come back on rx_p_i, rx_n_i (RX-014)
  // the line, in ns; what each one means: rtl/phy/asi_timing_pkg.sv
  parameter int unsigned WinEarlyNs    = asi_timing_pkg::WinEarlyNs,
  parameter int unsigned WinLateNs     = asi_timing_pkg::WinLateNs,
  parameter int unsigned FilterNs      = asi_timing_pkg::FilterNs,
  parameter int unsigned EchoMaxNs     = asi_timing_pkg::EchoMaxNs,
  parameter int unsigned RxOpenNs      = asi_timing_pkg::RxOpenNs,
  parameter int unsigned RxTimeoutNs   = asi_timing_pkg::RxTimeoutNs,
  parameter int unsigned GapOkNs       = asi_timing_pkg::GapOkNs,
  parameter int unsigned GapNorspNs    = asi_timing_pkg::GapNorspNs,
  parameter int unsigned GapErrNs      = asi_timing_pkg::GapErrNs,
  parameter int unsigned BabbleMaxNs   = asi_timing_pkg::BabbleMaxNs,
  parameter int unsigned IdleStartNs   = asi_timing_pkg::IdleStartNs,
  parameter int unsigned TxBiasNs      = asi_timing_pkg::TxBiasNs,
  parameter int unsigned ApfOnNs       = asi_timing_pkg::ApfOnNs,
  parameter int unsigned ApfOkNs       = asi_timing_pkg::ApfOkNs,
  parameter int unsigned EfNs          = asi_timing_pkg::EfNs,
  parameter int unsigned JabberNs      = asi_timing_pkg::JabberNs,
  parameter int unsigned VthClearNs    = asi_timing_pkg::VthClearNs,
  parameter int unsigned TxBias        = 12,          // codes of tx_dac_o while tx_en_o is on, 0..63
  parameter int unsigned DexgRetry     = 1,           // P_DEXG_RETRY
  parameter int unsigned FailCycles    = 3            // P_FAIL_CYCLES
) (
  input  logic        clk_i, rst_i,                   // rst_i: synchronous, active high
  // line: comparators (asynchronous), Manchester level and bias, supply too low (low) and earth fault (high)
  input  logic        rx_p_i, rx_n_i,
  output logic        tx_man_o, tx_en_o,
  output logic [7:0]  tx_dac_o,                       // current of a shaped sender, instead of the two above
  output logic        rx_vth_clear_o,                 // drop the amplitude held for the threshold
  input  logic        apf_ni, efault_i,
  // flash, SPI mode 0
  output logic        spi_sck_o, spi_cs_no, spi_mosi_o,
  input  logic        spi_miso_i,
  // native host port, word addresses: request and inputs held until ready (one clock); a read's data is valid with it
  input  logic        host_req_i, host_we_i,
  input  logic [13:2] host_addr_i,
  input  logic [3:0]  host_be_i,
  input  logic [31:0] host_wdata_i,
  output logic [31:0] host_rdata_o,
  output logic        host_ready_o,
  output logic        host_irq_o,                     // from a new input image until the host writes IRQ_ACK
  // for instruments and benches
  output logic        sync_o,                         // one clock, at the first request of each cycle
  output logic [2:0]  phase_o,                        // phase_e
  output logic        core_wait_o                     // the core sleeps in WAIT
);
  // ---------------------------------------------------------------- core, memories, registers, host window
  logic        tick_us, line_en, cycle_en, two_extra, out_hold, read_id, batch_start;
  logic [12:0] min_cycle_us;
  logic [6:0]  batch_len;
  logic [2:0]  exec_phase, slot_phase;
  logic        batch_busy, cycle_busy, cycle_done, exchange_done, batch_done, slave_lost, apf, efault;
  logic        jabber, mon_enable, mon_clear;
  logic [7:0]  mon_tail, mon_head;
  logic [15:0] mon_lost;
  logic        stat_req, stat_we, ring_req, ring_we;
  logic [9:0]  stat_addr;
  logic [8:0]  ring_addr;
  logic [31:0] stat_wdata, stat_rdata, ring_wdata;
  logic        mem_req, mem_we;
  logic [7:0]  mem_addr;
  logic [31:0] mem_wdata, mem_rdata;

  asi_soc #(
    .ClkHz(ClkHz), .RamWords(RamWords), .BootFromFlash(BootFromFlash), .FirmwareHex(FirmwareHex),
    .BootRomHex(BootRomHex)
  ) u_soc (
    .clk_i, .rst_i,
    .host_req_i, .host_we_i, .host_addr_i, .host_be_i, .host_wdata_i, .host_rdata_o, .host_ready_o, .host_irq_o,
    .spi_sck_o, .spi_cs_no, .spi_mosi_o, .spi_miso_i,
    .stat_req_i(stat_req), .stat_we_i(stat_we), .stat_addr_i(stat_addr), .stat_wdata_i(stat_wdata),
    .stat_rdata_o(stat_rdata),
    .ring_req_i(ring_req), .ring_we_i(ring_we), .ring_addr_i(ring_addr), .ring_wdata_i(ring_wdata),
    .seq_req_i(mem_req), .seq_we_i(mem_we), .seq_addr_i(mem_addr), .seq_wdata_i(mem_wdata), .seq_rdata_o(mem_rdata),
    .tick_us_o(tick_us), .line_en_o(line_en), .cycle_en_o(cycle_en), .two_extra_o(two_extra),
    .out_hold_o(out_hold), .read_id_o(read_id), .min_cycle_us_o(min_cycle_us),
    .batch_start_o(batch_start), .batch_len_o(batch_len),
    .exec_phase_o(exec_phase),
    .batch_busy_i(batch_busy), .cycle_busy_i(cycle_busy), .apf_i(apf), .efault_i(efault),
    .cycle_done_i(cycle_done), .exchange_done_i(exchange_done), .batch_done_i(batch_done), .slave_lost_i(slave_lost),
    .jabber_i(jabber),
    .mon_enable_o(mon_enable), .mon_clear_o(mon_clear), .mon_tail_o(mon_tail), .mon_head_i(mon_head),
    .mon_lost_i(mon_lost),
    .core_wait_o
  );

  // ---------------------------------------------------------------- the line
  logic        enable;                                // LT-011: nothing starts without power
  logic        req_valid, req_ready, req_no_reply, req_sel, res_valid, sent, is_repeat;
  logic [10:0] req_call;
  logic [1:0]  req_retries, res_repeats;
  logic [3:0]  res_data;
  asi_map_pkg::error_class_e res_last, res_first, att_class;
  logic        att_valid, att_repeat, att_final, att_dev_late, pulse_n, pulse_p;
  logic [5:0]  att_index;
  logic [15:0] att_delay;
  logic [7:0]  att_dev;
  logic        man, man_en;                           // from asi_xact, before the jabber guard

  assign enable  = line_en & ~apf;
  assign phase_o = cycle_busy ? slot_phase : exec_phase;

  asi_seq #(.DexgRetry(DexgRetry), .FailCycles(FailCycles)) u_seq (
    .clk_i, .rst_i,
    .mem_req_o(mem_req), .mem_we_o(mem_we), .mem_addr_o(mem_addr), .mem_wdata_o(mem_wdata), .mem_rdata_i(mem_rdata),
    .req_valid_o(req_valid), .req_ready_i(req_ready), .req_call_o(req_call), .req_retries_o(req_retries),
    .req_no_reply_o(req_no_reply), .req_sel_o(req_sel),
    .res_valid_i(res_valid), .res_last_i(res_last), .res_first_i(res_first), .res_data_i(res_data),
    .res_repeats_i(res_repeats), .sent_i(sent), .repeat_i(is_repeat),
    .enable_i(enable), .cycle_en_i(cycle_en), .two_extra_i(two_extra), .out_hold_i(out_hold), .read_id_i(read_id),
    .min_cycle_us_i(min_cycle_us), .tick_us_i(tick_us), .batch_start_i(batch_start), .batch_len_i(batch_len),
    .batch_busy_o(batch_busy), .cycle_busy_o(cycle_busy), .batch_done_o(batch_done), .cycle_done_o(cycle_done),
    .slave_lost_o(slave_lost), .exchange_done_o(exchange_done), .slot_phase_o(slot_phase), .sync_o
  );

  asi_xact #(
    .ClkHz(ClkHz), .ReadBack(ReadBack), .WinEarlyNs(WinEarlyNs), .WinLateNs(WinLateNs), .FilterNs(FilterNs),
    .EchoMaxNs(EchoMaxNs), .RxOpenNs(RxOpenNs), .RxTimeoutNs(RxTimeoutNs), .GapOkNs(GapOkNs), .GapNorspNs(GapNorspNs),
    .GapErrNs(GapErrNs), .BabbleMaxNs(BabbleMaxNs), .IdleStartNs(IdleStartNs), .TxBiasNs(TxBiasNs)
  ) u_xact (
    .clk_i, .rst_i, .enable_i(enable),
    .req_valid_i(req_valid), .req_ready_o(req_ready), .req_call_i(req_call), .req_sel_i(req_sel),
    .req_retries_i(req_retries), .req_no_reply_i(req_no_reply),
    .res_valid_o(res_valid), .res_last_o(res_last), .res_first_o(res_first), .res_data_o(res_data),
    .res_repeats_o(res_repeats), .sent_o(sent), .repeat_o(is_repeat),
    .att_valid_o(att_valid), .att_index_o(att_index), .att_class_o(att_class), .att_repeat_o(att_repeat),
    .att_final_o(att_final), .att_delay_o(att_delay), .att_dev_o(att_dev), .att_dev_late_o(att_dev_late),
    .pulse_n_o(pulse_n), .pulse_p_o(pulse_p),
    .rx_p_i, .rx_n_i, .tx_man_o(man), .tx_en_o(man_en)
  );

  asi_tx_guard #(.ClkHz(ClkHz), .JabberNs(JabberNs)) u_tx_guard (
    .clk_i, .rst_i, .man_i(man), .en_i(man_en), .tx_man_o, .tx_en_o, .jabber_o(jabber)
  );

  asi_tx_shape #(.ClkHz(ClkHz), .TxBias(TxBias)) u_tx_shape (
    .clk_i, .rst_i, .man_i(tx_man_o), .en_i(tx_en_o), .dac_o(tx_dac_o)
  );

  asi_vth #(.ClkHz(ClkHz), .VthClearNs(VthClearNs)) u_vth (
    .clk_i, .rst_i, .n_start_i(pulse_n), .p_start_i(pulse_p), .rx_vth_clear_o
  );

  asi_line_guard #(.ApfOnNs(ApfOnNs), .ApfOkNs(ApfOkNs), .EfNs(EfNs)) u_guard (
    .clk_i, .rst_i, .tick_i(tick_us), .apf_ni, .efault_i, .apf_o(apf), .efault_o(efault)
  );

  asi_stats u_stats (
    .clk_i, .rst_i,
    .att_valid_i(att_valid), .att_index_i(att_index), .att_class_i(att_class), .att_repeat_i(att_repeat),
    .att_final_i(att_final), .att_delay_i(att_delay), .att_dev_i(att_dev), .att_dev_late_i(att_dev_late),
    .mem_req_o(stat_req), .mem_we_o(stat_we), .mem_addr_o(stat_addr), .mem_wdata_o(stat_wdata),
    .mem_rdata_i(stat_rdata)
  );

  asi_monitor #(
    .ClkHz(ClkHz), .WinEarlyNs(WinEarlyNs), .WinLateNs(WinLateNs), .FilterNs(FilterNs),
    .RxOpenNs(RxOpenNs), .RxTimeoutNs(RxTimeoutNs)
  ) u_monitor (
    .clk_i, .rst_i, .n_start_i(pulse_n), .p_start_i(pulse_p), .enable_i(mon_enable), .clear_i(mon_clear),
    .tail_i(mon_tail), .head_o(mon_head), .lost_o(mon_lost),
    .mem_req_o(ring_req), .mem_we_o(ring_we), .mem_addr_o(ring_addr), .mem_wdata_o(ring_wdata)
  );

`ifndef SYNTHESIS
  // readable telegrams in waveforms; without waves the simulator removes it
  asi_trace u_trace (
    .clk_i, .rst_i, .req_i(req_valid & req_ready), .req_call_i(req_call), .res_i(res_valid), .res_class_i(res_last),
    .res_data_i(res_data), .phase_i(asi_map_pkg::phase_e'(phase_o)),
    .request_text_o(), .answer_text_o(), .phase_text_o()
  );

  initial begin
    RamWords_A: assert (RamWords >= 256 && RamWords <= 16384 && (RamWords & (RamWords - 1)) == 0);
  end
`endif
endmodule
