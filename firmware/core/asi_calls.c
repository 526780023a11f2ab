/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_calls.c  The call table. */
#include "asi_calls.h"

#define CB 0x400u     /* command bit */
#define I4_WPAR 0x10u /* CB 0: parameter instead of data */
#define I3 0x08u

static uint16_t payload(unsigned cb, unsigned index, unsigned info)
{
    return (uint16_t)(cb | (index & 31u) << 5 | (info & 31u));
}

/** D3 or ~Sel, D2..D0 */
static unsigned nibble(unsigned index, unsigned data, bool extended)
{
    if (index & 32u)
        return data & 7u;
    return extended ? (data & 7u) | I3 : data & 15u;
}

uint16_t asi_call_dexg(unsigned index, unsigned data, bool extended)
{
    return payload(0, index, nibble(index, data, extended));
}

uint16_t asi_call_wpar(unsigned index, unsigned parameter, bool extended)
{
    return payload(0, index, I4_WPAR | nibble(index, parameter, extended));
}

uint16_t asi_call_adra(unsigned number)
{
    return payload(0, 0, number);
}

uint16_t asi_call_wid1(unsigned id1)
{
    return payload(CB, 0, id1 & 15u);
}

uint16_t asi_call_command(asi_command_t command, unsigned index)
{
    return payload(CB, index, (unsigned)command ^ ((index & 32u) ? I3 : 0u));
}

unsigned asi_call_index(uint16_t call, bool extended)
{
    const unsigned number = (unsigned)call >> 5 & 31u;
    const bool i3 = (call & I3) != 0u;
    bool sel; /* CA-004: DEXG, WPAR, RES, RDST and R1 carry ~Sel, the other commands Sel */
    if (number == 0u)
        sel = false;
    else if (!(call & CB))
        sel = extended && !i3;
    else
        sel = (call & 0x14u) == 0x14u ? !i3 : i3;
    return number + (sel ? 32u : 0u);
}

uint16_t asi_call_execute(unsigned number, unsigned info)
{
    const uint16_t call = payload(CB, number, info);
    if (number > 31u || info > 31u)
        return 0;
    if (call == ASI_CALL_BR01 || (number == 0u && info < 16u)) /* broadcast; WID1 with any code */
        return call;
    switch (info & ~I3) {
    case 0x10: case 0x11: case 0x12: case 0x13: /* RDIO RDID RID1 RID2 */
    case 0x14:                                  /* RES */
    case 0x16: case 0x17:                       /* RDST R1 */
        return call;
    default: /* DELA, PRGM, reserved codes */
        return 0;
    }
}

bool asi_call_is_legal(uint16_t call)
{
    if (call >= 0x800u)
        return false;
    if (!(call & CB)) /* DEXG, WPAR; at address 0 ADRA */
        return true;
    return (call & 0x17u) == ASI_CMD_DELA || asi_call_execute((unsigned)call >> 5 & 31u, call & 31u) != 0u;
}
