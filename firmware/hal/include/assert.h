/* SPDX-License-Identifier: Apache-2.0 */
/** @file assert.h  The part of <assert.h> that a freestanding compiler lacks and the generated headers use. */
#ifndef ASI_FREESTANDING_ASSERT_H
#define ASI_FREESTANDING_ASSERT_H
#ifndef __cplusplus
#undef static_assert
#define static_assert _Static_assert
#endif
#endif
