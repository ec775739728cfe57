#ifndef GIMNET_EXPORT_H
#define GIMNET_EXPORT_H

/* GIMNET_API marks the functions that a shared libgimnet offers. The library is compiled with
 * hidden symbols, so everything without the mark belongs to the library alone. */
#if defined(__GNUC__)
#define GIMNET_API __attribute__((visibility("default")))
#else
#define GIMNET_API
#endif

#endif
