// SPDX-License-Identifier: Apache-2.0
// serial_host: the host port of asi_master on five pins, for size and speed runs: the port has more signals than a
// small package has pins, and a port tied off would let the tools remove half of the chip.
// 49 bits in (we, addr, be, wdata, MSB first, one per clock while frame_i), the access starts when frame_i falls;
// 32 bits of read data come out one per clock while frame_i. Costs about 90 cells; they are part of the numbers.
module serial_host (
  input  logic        clk_i, rst_i,      // rst_i: synchronous, active high
  input  logic        frame_i, data_i,
  output logic        data_o, busy_o,
  output logic        host_req_o, host_we_o,
  output logic [13:2] host_addr_o,
  output logic [3:0]  host_be_o,
  output logic [31:0] host_wdata_o,
  input  logic [31:0] host_rdata_i,
  input  logic        host_ready_i
);
  logic [48:0] shift_q;
  logic        frame_q;
  assign {host_we_o, host_addr_o, host_be_o, host_wdata_o} = shift_q;
  assign data_o = shift_q[31];
  assign busy_o = host_req_o;
  always_ff @(posedge clk_i) begin
    frame_q <= ~rst_i & frame_i;
    if (rst_i || (host_req_o && host_ready_i)) host_req_o <= 1'b0;
    else if (frame_q && !frame_i)              host_req_o <= 1'b1;
    if (frame_i)                               shift_q <= {shift_q[47:0], data_i};
    else if (host_req_o && host_ready_i)       shift_q[31:0] <= host_rdata_i;
  end
endmodule
