#pragma once

// clang's thread-safety annotations (-Wthread-safety); nothing with other compilers.

#if defined(__clang__)
#define GIMNET_THREAD_ANNOTATION(attribute) __attribute__((attribute))
#else
#define GIMNET_THREAD_ANNOTATION(attribute)
#endif

#define GIMNET_CAPABILITY(name) GIMNET_THREAD_ANNOTATION(capability(name))
#define GIMNET_SCOPED_CAPABILITY GIMNET_THREAD_ANNOTATION(scoped_lockable)
#define GIMNET_GUARDED_BY(mutex) GIMNET_THREAD_ANNOTATION(guarded_by(mutex))
#define GIMNET_REQUIRES(...) GIMNET_THREAD_ANNOTATION(requires_capability(__VA_ARGS__))
#define GIMNET_EXCLUDES(...) GIMNET_THREAD_ANNOTATION(locks_excluded(__VA_ARGS__))
#define GIMNET_ACQUIRE(...) GIMNET_THREAD_ANNOTATION(acquire_capability(__VA_ARGS__))
#define GIMNET_RELEASE(...) GIMNET_THREAD_ANNOTATION(release_capability(__VA_ARGS__))
#define GIMNET_NO_THREAD_SAFETY_ANALYSIS GIMNET_THREAD_ANNOTATION(no_thread_safety_analysis)
