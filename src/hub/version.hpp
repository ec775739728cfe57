#pragma once

namespace gimnet::hub {

/// Of this program, as the build says.
inline constexpr const char* kVersion = GIMNET_VERSION;

}  // namespace gimnet::hub
