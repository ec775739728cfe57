#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Connects to the hub, sends "hello hub" to the peer, expects "hi" from it. 0: all was right. */
int nif_c_talk(const char* url, uint32_t peer);

#ifdef __cplusplus
}
#endif
