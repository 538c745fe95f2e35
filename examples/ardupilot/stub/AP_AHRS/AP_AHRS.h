#pragma once
/* Declarations as ArduPilot's AP_AHRS has them; no code of it. */
#include <AP_Math/AP_Math.h>

class AP_AHRS {
public:
    const Vector3f &get_gyro() const;
    const Matrix3f &get_rotation_body_to_ned() const;
    bool get_velocity_NED(Vector3f &vec) const __attribute__((warn_unused_result));
    bool airspeed_TAS(float &airspeed_ret) const __attribute__((warn_unused_result));
};

namespace AP {
AP_AHRS &ahrs();
}
