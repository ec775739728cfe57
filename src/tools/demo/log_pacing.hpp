#pragma once

#include "tools/demo/carmen_log.hpp"

namespace gimnet::demo {

/// Longest pause that a playback keeps, in seconds: longer ones are gaps of the recording, not of
/// the drive.
inline constexpr double kLongestPause_s = 5.0;
/// How long before the robot first moves or scans a playback begins, in seconds.
inline constexpr double kLeadIn_s = 1.0;
/// A shorter standing still at the beginning is played, in seconds.
inline constexpr double kShortestLeftOut_s = 5.0;

/// Fills in `due_s` of every record and the note. Records keep their order. Stamps that step back,
/// as merged logs have them, are played at once; the standing still at the beginning is left out.
/// Where the stamps were rounded until nothing is left of them, the robot's way sets the pace: 0.5
/// m/s and 0.8 rad/s. REQUIRES: at least one record.
void pace_log(RobotLog& log);

}  // namespace gimnet::demo
