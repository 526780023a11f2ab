// SPDX-License-Identifier: Apache-2.0
// asi_line_rx.cpp: C entry of the Verilated receivers (tb/asi_line_rx.sv). Behind tb/asi_line_rx.h.
#include "asi_line_rx.h"

#include <verilated.h>

#include <memory>

#include "Vasi_line_rx.h"

extern "C" int asi_line_rx_run(const uint8_t *levels, int clocks, int enable, int bits, asi_line_rx_result *result) {
    if (!levels || !result || clocks < 0 || (bits != 7 && bits != 14)) return -1;
    // one model per thread, reset for every run: making one costs more than a telegram
    thread_local VerilatedContext context;
    thread_local auto top = std::make_unique<Vasi_line_rx>(&context);
    auto clock = [&] {
        top->clk_i = 0;
        top->eval();
        top->clk_i = 1;
        top->eval();
    };
    top->rst_i = 1;
    top->rx_n_i = top->rx_p_i = top->en_i = 0;
    for (int k = 0; k < 4; k++) clock();
    top->rst_i = 0;
    *result = {-1, -1, -1, 0, 0, {}};
    for (int k = 0; k < clocks; k++) {
        top->rx_n_i = levels[k] & 1;
        top->rx_p_i = levels[k] >> 1 & 1;
        top->en_i = k >= enable;
        // outputs of this clock, before its edge, with the inputs of this clock
        top->clk_i = 0;
        top->eval();
        if ((top->n_start_o || top->p_start_o) && result->strobes < ASI_LINE_RX_STROBES)
            result->strobe[result->strobes++] = k << 2 | top->p_start_o << 1 | top->n_start_o;
        const bool first = bits == 7 ? top->ans_first_o : top->req_first_o;
        const bool done = bits == 7 ? top->ans_done_o : top->req_done_o;
        if (first && result->first < 0) result->first = k;
        if (done && result->done < 0) {
            result->done = k;
            result->error_class = bits == 7 ? top->ans_class_o : top->req_class_o;
            result->data = bits == 7 ? top->ans_data_o : top->req_data_o;
        }
        top->clk_i = 1;
        top->eval();
    }
    return 0;
}
