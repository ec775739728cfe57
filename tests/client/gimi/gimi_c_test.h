#pragma once

#ifdef __cplusplus
extern "C" {
#endif

/* Each: 0, or the line of what was wrong, which is printed. */
int gimi_c_talk(const char* url);
int gimi_c_batch(const char* url);
int gimi_c_misuse(const char* url);
int gimi_c_later_versions(const char* url);

#ifdef __cplusplus
}
#endif
