#pragma once

#include <string_view>

#include "lapservo/core/angles.h"
#include "lapservo/tool/dvrk_tool_file.h"

namespace lapservo::internal {

/// In the form of dVRK's tool files, with comments where theirs have them; of no tool that exists.
inline constexpr std::string_view invented_tool_json = R"(/* -*- Mode: Javascript -*- */
{
    // a comment with "quotes" and a brace {
    "DH": {
        "convention": "modified",
        "joints": [
            {   "name": "roll",
                "alpha":  0.0000, "A":  0.0000, "theta":  0.3000, "D":  0.4100,
                "type": "revolute", "mode": "active",
                "offset":  0.0000,
                "qmin": -4.5, // -258 degrees
                "qmax":  4.5, "ftmax": 0.33
            },
            {   "name": "wrist_pitch",
                "alpha": -1.5708, "A":  0.0000, "theta":  0.0000, "D":  0.0000,
                "type": "revolute", "mode": "active",
                "offset": -1.5708
            },
            {   "name": "wrist_yaw",
                "alpha": -1.5708, "A":  0.0085, "theta":  0.1000, "D":  0.0010,
                "type": "revolute", "mode": "active",
                "offset": -1.5
            }
        ]
    }
    ,
    "jaw" : { "qmin": -0.5, "qmax":  1.2, "ftmax": 0.16 }
    ,
    "tooltip_offset" : [[ 0.0, -1.0,  0.0,  0.0],
                        [ 0.0,  0.0,  1.0,  0.010],
                        [-1.0,  0.0,  0.0,  0.0],
                        [ 0.0,  0.0,  0.0,  1.0]]
    ,
    "coupling" : {
        "ActuatorToJointPosition" : [[ -1.5632,  0.0000], [  0.0000,  1.0186]] // "//
    }
}
)";

/// Like dVRK's needle drivers, in no place: pitch and yaw, then a jaw of 10 mm.
inline Tool needle_driver() {
  Tool tool;
  tool.wrist = {{.name = "wrist_pitch", .alpha_rad = -pi / 2, .theta_rad = -pi / 2},
                {.name = "wrist_yaw", .alpha_rad = -pi / 2, .a_m = 0.0091, .theta_rad = -pi / 2}};
  tool.last_from_tip.translation = {0, 0.0102, 0};
  return tool;
}

/// The invented one in a place, with standard deviations of it.
inline Tool placed_tool() {
  Tool tool = parse_dvrk_tool(invented_tool_json, "invented.json");
  tool.wrist[0].offset_rad = 0.02, tool.wrist[1].offset_rad = -0.03;
  Tool::Place& place = tool.place.emplace();
  place.base_in_marker_m = {1e-4, -2e-4, 0.04}, place.azimuth_rad = 0.7;
  place.covariance.diagonal() << 1e-8, 2e-8, 4e-8, 1e-4, 2e-4, 3e-4, 0, 0;
  place.covariance(2, 4) = place.covariance(4, 2) = 1e-6;
  return tool;
}

}  // namespace lapservo::internal
