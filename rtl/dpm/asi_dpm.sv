// SPDX-License-Identifier: Apache-2.0
// asi_dpm: the 16 KB dual-port memory: one single-port RAM, shared by the core and the native host port.
// Bus rule, both ports: a request and its inputs are held until ready (one clock); a read's data is valid with it.
// An access takes two clocks, and a port cannot begin one in the clock of its ready, so with both ports always busy
// they take turns and neither waits longer than one clock. Reset clears MAGIC, so that a host never takes the window of
// the time before for a new one. Requirements: HW-001, HW-006.
module asi_dpm (
  input  logic        clk_i, rst_i,               // rst_i: synchronous, active high
  // core
  input  logic        core_req_i, core_we_i,
  input  logic [3:0]  core_be_i,
  input  logic [13:2] core_addr_i,
  input  logic [31:0] core_wdata_i,
  output logic [31:0] core_rdata_o,
  output logic        core_ready_o,
  // host
  input  logic        host_req_i, host_we_i,
  input  logic [3:0]  host_be_i,
  input  logic [13:2] host_addr_i,
  input  logic [31:0] host_wdata_i,
  output logic [31:0] host_rdata_o,
  output logic        host_ready_o,
  // events
  input  logic        irq_set_i,                  // pulse: raise host_irq_o; wins over an acknowledge in the same clock
  output logic        host_irq_o,                 // until the host writes IRQ_ACK
  output logic        host_attn_o                 // pulse: the host writes HOST_SEQ
);
  localparam logic [13:2] HostSeqWord = 12'(asi_map_pkg::HostHostSeq / 4);
  localparam logic [13:2] IrqAckWord  = 12'(asi_map_pkg::HostIrqAck / 4);

  logic        core_go, host_go;
  logic [31:0] rdata;

  assign core_go = core_req_i & ~core_ready_o;                // a tie goes to the core
  assign host_go = host_req_i & ~host_ready_o & ~core_go;

  asi_ram #(.Words(4096)) u_ram (
    .clk_i,
    .req_i   (rst_i | core_go | host_go),
    .we_i    (rst_i | (core_go ? core_we_i : host_we_i)),
    .be_i    ({4{rst_i}} | (core_go ? core_be_i : host_be_i)),
    .addr_i  (rst_i ? 12'(asi_map_pkg::HostMagic / 4) : core_go ? core_addr_i : host_addr_i),
    .wdata_i (rst_i ? '0 : core_go ? core_wdata_i : host_wdata_i),
    .rdata_o (rdata)
  );
  assign core_rdata_o = rdata;
  assign host_rdata_o = rdata;
  assign host_attn_o  = host_go & host_we_i & (host_addr_i == HostSeqWord);

  always_ff @(posedge clk_i) begin
    core_ready_o <= ~rst_i & core_go;
    host_ready_o <= ~rst_i & host_go;
    if (rst_i)                                                       host_irq_o <= 1'b0;
    else if (irq_set_i)                                              host_irq_o <= 1'b1;
    else if (host_go && host_we_i && host_addr_i == IrqAckWord)      host_irq_o <= 1'b0;
  end

`ifndef SYNTHESIS
  logic       core_held_q, host_held_q;
  logic [1:0] core_wait_q, host_wait_q;                              // clocks a request has been waiting
  logic [48:0] core_q, host_q;
  always_ff @(posedge clk_i) begin
    core_held_q <= !rst_i && core_req_i && !core_ready_o;
    host_held_q <= !rst_i && host_req_i && !host_ready_o;
    core_wait_q <= (rst_i || !core_req_i || core_ready_o) ? 2'd0 : core_wait_q + 2'd1;
    host_wait_q <= (rst_i || !host_req_i || host_ready_o) ? 2'd0 : host_wait_q + 2'd1;
    core_q      <= {core_we_i, core_be_i, core_addr_i, core_wdata_i};
    host_q      <= {host_we_i, host_be_i, host_addr_i, host_wdata_i};
    if (!rst_i) begin
      CoreHeld_A: assert (!core_held_q || (core_req_i && core_q == {core_we_i, core_be_i, core_addr_i, core_wdata_i}));
      HostHeld_A: assert (!host_held_q || (host_req_i && host_q == {host_we_i, host_be_i, host_addr_i, host_wdata_i}));
      CoreWait_A: assert (core_wait_q <= 2'd1);
      HostWait_A: assert (host_wait_q <= 2'd2);
      Both_C:     cover (core_go && host_req_i);
      IrqRace_C:  cover (irq_set_i && host_irq_o);
    end
  end
`endif
endmodule
