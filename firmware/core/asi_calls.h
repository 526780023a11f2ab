/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_calls.h  The master calls as 11-bit request payloads: CB A4..A0 I4..I0 (CA-001 .. CA-004).
 * An index is number + 32 * Sel: 1..31 = standard or A, 33..63 = 1B..31B. Nibbles are at line level. Pure functions.
 */
#ifndef ASI_CALLS_H
#define ASI_CALLS_H
#include <stdbool.h>
#include <stdint.h>

/** Commands to one slave: I4..I0 for Sel = 0; for Sel = 1 bit I3 is inverted (CA-004). */
typedef enum {
    ASI_CMD_DELA = 0x00, /**< Delete_Address, answer 0 */
    ASI_CMD_RDIO = 0x10, /**< Read_IO_Configuration */
    ASI_CMD_RDID = 0x11, /**< Read_ID_Code */
    ASI_CMD_RID1 = 0x12, /**< Read_Extended_ID-Code_1 */
    ASI_CMD_RID2 = 0x13, /**< Read_Extended_ID-Code_2 */
    ASI_CMD_RES = 0x1C,  /**< Reset_Slave, answer 6 */
    ASI_CMD_RDST = 0x1E, /**< Read_Status */
    ASI_CMD_R1 = 0x1F,   /**< Read_Reset_Status of specification 2.0: status, then cleared; on demand only */
} asi_command_t;

/** Broadcast reset to all slaves; nobody answers. */
#define ASI_CALL_BR01 ((uint16_t)0x7F5)

/** Data_Exchange. extended: I3 is ~Sel instead of D3; always so for a B index. */
uint16_t asi_call_dexg(unsigned index, unsigned data, bool extended);
/** Write_Parameter; I3 as in asi_call_dexg. */
uint16_t asi_call_wpar(unsigned index, unsigned parameter, bool extended);
/** Address_Assignment of number 0..31 to the slave at address 0, answer 6. */
uint16_t asi_call_adra(unsigned number);
/** Write_Extended_ID-Code_1 to the slave at address 0, answer 0. */
uint16_t asi_call_wid1(unsigned id1);
/** A command of the list above to one slave. */
uint16_t asi_call_command(asi_command_t command, unsigned index);
/** Index a call is meant for. extended: the number has A/B slaves, so I3 of DEXG and WPAR is ~Sel and not data. */
unsigned asi_call_index(uint16_t call, bool extended);
/** Execute_Command: the payload of number 0..31 and I4..I0, when it is one that function may send (FN-022); else 0. */
uint16_t asi_call_execute(unsigned number, unsigned info);
/** Whether a master may send this payload: one of the calls above, and not Enter_Program_Mode or a reserved code. */
bool asi_call_is_legal(uint16_t call);
#endif
