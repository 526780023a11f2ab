/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_status.h  The one enumeration of errors of the firmware (EX-025).
 * 0 is success; errors are negative and a number is never reused. A function that returns one has changed nothing;
 * an address change that ends with one may have left the slave at address 0 or at its old one
 * (docs/execution_control.md).
 */
#ifndef ASI_STATUS_H
#define ASI_STATUS_H
typedef enum {
    ASI_OK = 0,
    ASI_E_ARG = -1,     /**< an argument is out of range (index, list with 0 or 32 set, nibble above F, unknown bit) */
    ASI_E_STATE = -2,   /**< not possible in this phase: no normal operation */
    ASI_E_BUSY = -3,    /**< one is already open; ask again later */
    ASI_E_ABORTED = -4, /**< the open call was dropped because the line went offline */
    ASI_E_PROTECTED = -5,         /**< not in protected mode */
    ASI_E_SLAVE0 = -6,            /**< a slave with address 0 is detected */
    ASI_E_NOT_DETECTED = -7,      /**< the slave is not in LDS */
    ASI_E_NOT_ACTIVE = -8,        /**< the slave is not in LAS */
    ASI_E_ADDRESS_USED = -9,      /**< the new address is taken, or its number belongs to a slave of the other kind */
    ASI_E_NO_ANSWER = -10,        /**< no valid answer after all repetitions */
    ASI_E_DELETE = -11,           /**< the old address could not be deleted */
    ASI_E_READ_ID1 = -12,         /**< ID1 of the slave at address 0 could not be read */
    ASI_E_WRITE_ID1 = -13,        /**< ID1 was refused or reads back differently */
    ASI_E_ID1_TEMPORARY = -14,    /**< the slave did not store ID1 for good */
    ASI_E_SET_ADDRESS = -15,      /**< the new address was refused; the old one was tried again */
    ASI_E_ADDRESS_TEMPORARY = -16, /**< the slave has the address but did not store it for good */
    ASI_E_PROFILE = -17,          /**< the slave's profile has no such service */
    ASI_E_OVERFLOW = -18,         /**< string longer than the buffer or than the slave takes */
    ASI_E_AUTO_CLEAR = -19,       /**< refused: the master is in the auto-clear end state */
    ASI_E_AUTO_CLEAR_MODE = -20,  /**< auto clear does not go with automatic addressing or configuration mode */
    ASI_E_POWER = -21,            /**< the line has no power */
    ASI_E_OFFLINE = -22,          /**< the offline phase was asked for */
    ASI_E_TRANSFER = -23,         /**< combined transaction broken off: time-out or marked invalid by the slave */
    ASI_E_DEVICE = -24,           /**< the slave answered a message with an error */
    ASI_E_STORE = -25,            /**< no flash, or it cannot be written */
} asi_status_t;
#if defined(__GNUC__)
#define ASI_MUST_USE __attribute__((warn_unused_result))
#else
#define ASI_MUST_USE
#endif
#endif
