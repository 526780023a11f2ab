#ifndef ASI_PERSIST_H
#define ASI_PERSIST_H
#include "asi_store.h"
const asi_permanent_t *asi_persist_open(void);
void asi_persist_request(const asi_permanent_t *now);
void asi_persist_serve(void);
uint32_t asi_persist_word(void);
#endif
