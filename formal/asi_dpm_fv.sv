// SPDX-License-Identifier: Apache-2.0
// Proof of asi_dpm, unbounded: HW-006 (each port reads what was written last, byte by byte, whoever wrote; a wait has a
// bound; one owner), HW-001 (reset clears MAGIC), HW-005 (no interrupt is lost, and it falls with IRQ_ACK only).
module asi_dpm_fv (
  input logic        clk_i, rst_i, core_req_i, core_we_i, host_req_i, host_we_i, irq_set_i,
  input logic [3:0]  core_be_i, host_be_i,
  input logic [13:2] core_addr_i, host_addr_i,
  input logic [31:0] core_wdata_i, host_wdata_i
);
  localparam logic [13:2] Magic   = 12'(asi_map_pkg::HostMagic / 4);
  localparam logic [13:2] HostSeq = 12'(asi_map_pkg::HostHostSeq / 4);
  localparam logic [13:2] IrqAck  = 12'(asi_map_pkg::HostIrqAck / 4);
  logic [31:0] core_rdata, host_rdata;
  logic        core_ready, host_ready, irq, attn;
  asi_dpm dut (
    .clk_i, .rst_i, .core_req_i, .core_we_i, .core_be_i, .core_addr_i, .core_wdata_i, .core_rdata_o(core_rdata),
    .core_ready_o(core_ready), .host_req_i, .host_we_i, .host_be_i, .host_addr_i, .host_wdata_i,
    .host_rdata_o(host_rdata), .host_ready_o(host_ready), .irq_set_i, .host_irq_o(irq), .host_attn_o(attn)
  );

  logic        init_q = 1'b1, live_q = 1'b0, rst_q;
  logic        core_held_q, host_held_q, irq_q, set_q, attn_q;
  logic [48:0] core, host, core_q, host_q;
  logic [31:0] shadow_q, merged;    // the watched word as the two ports must see it; with the write that ends now
  logic [13:2] watch;
  logic        core_hit, host_hit, ack;
  logic [2:0]  core_age_q, host_age_q;  // clocks a request has been open
  assign core     = {core_we_i, core_be_i, core_addr_i, core_wdata_i};
  assign host     = {host_we_i, host_be_i, host_addr_i, host_wdata_i};
  assign watch    = dut.u_ram.watch_q;
  assign core_hit = core_ready && core_addr_i == watch;
  assign host_hit = host_ready && host_addr_i == watch;
  assign ack      = host_ready && host_we_i && host_addr_i == IrqAck;
  always_comb begin
    merged = shadow_q;
    for (int b = 0; b < 4; b++) begin
      if (core_hit && core_we_i && core_be_i[b]) merged[8*b +: 8] = core_wdata_i[8*b +: 8];
      if (host_hit && host_we_i && host_be_i[b]) merged[8*b +: 8] = host_wdata_i[8*b +: 8];
    end
  end

  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    // the bus rule: held until ready
    assume (!core_held_q || (core_req_i && core == core_q));
    assume (!host_held_q || (host_req_i && host == host_q));
    core_held_q <= !rst_i && core_req_i && !core_ready;
    host_held_q <= !rst_i && host_req_i && !host_ready;
    core_q <= core;
    host_q <= host;
    live_q <= 1'b1;
    rst_q  <= rst_i;
    set_q  <= irq_set_i;
    irq_q  <= irq;
    attn_q <= attn;
    core_age_q <= (rst_i || !core_req_i || core_ready) ? '0 : core_age_q + 1'b1;
    host_age_q <= (rst_i || !host_req_i || host_ready) ? '0 : host_age_q + 1'b1;
    shadow_q   <= rst_i ? (watch == Magic ? '0 : dut.u_ram.word_q) : merged;
    if (live_q) begin
      Owner_A:    assert (!(core_ready && host_ready));
      Word_A:     assert (dut.u_ram.word_q == merged);
      Core_A:     assert (rst_q || !(core_hit && !core_we_i) || core_rdata == shadow_q);
      Host_A:     assert (rst_q || !(host_hit && !host_we_i) || host_rdata == shadow_q);
      Magic_A:    assert (!rst_q || watch != Magic || dut.u_ram.word_q == '0);
      CoreWait_A: assert (core_age_q <= 3'd2);
      HostWait_A: assert (host_age_q <= 3'd2);
      Asked_A:    assert (rst_i || ((!core_ready || core_held_q) && (!host_ready || host_held_q)));
      if (rst_q) Reset_A: assert (!irq && !core_ready && !host_ready);
      else begin
        Set_A:    assert (!set_q || irq);                                  // wins over an acknowledge
        Keep_A:   assert (!irq_q || irq || (ack && !set_q));
        Clear_A:  assert (!ack || set_q || !irq);
        Cause_A:  assert (!irq || irq_q || set_q);
        Attn_A:   assert (attn_q == (host_ready && host_we_i && host_addr_i == HostSeq));
      end
    end
    if (live_q && !rst_i && !rst_q) begin
      Turns_C:  cover (core_ready && host_held_q && host_age_q == 3'd1);
      Mixed_C:  cover (host_hit && !host_we_i && shadow_q == 32'h11220044 && watch != Magic && core_req_i);
      Race_C:   cover (ack && set_q && irq);
      Acked_C:  cover (irq_q && !irq);
      Seq_C:    cover (attn_q && host_ready);
    end
  end
endmodule
