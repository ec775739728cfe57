#pragma once

/// The inline namespace of gimnet/gimi.hpp. Code without exceptions has one of its own: value()
/// without a value ends the program there, so that it is another function. A program may have parts
/// of both kinds.
#if defined(__cpp_exceptions)
#define GIMNET_GIMI_NAMESPACE v0_10
#else
#define GIMNET_GIMI_NAMESPACE v0_10_without_exceptions
#endif
