#include "AP_LPVControl.h"

#include <AP_AHRS/AP_AHRS.h>
#include <AP_HAL/AP_HAL.h>

static_assert(int(CONTROLLER_NY) == int(MONITOR_NY), "controller and monitor are of two designs");

namespace {
const uint32_t PERIOD_US = uint32_t(CONTROLLER_DT * 1e6f + 0.5f);
}

void AP_LPVControl::init()
{
    controller_init(&_controller);
    monitor_init(&_monitor);
    for (float &u : _command) {
        u = 0.0f;
    }
    _status = 0;
    _hypotheses = MONITOR_UNKNOWN;
    _due_us = _last_us = 0;
    _running = false;
}

void AP_LPVControl::enter(const float *in_force)
{
    init();
    controller_enter(&_controller, in_force);
    for (int i = 0; i < CONTROLLER_NY; i++) {
        _command[i] = in_force[i];
    }
}

// What is not known is not a number, which the controller holds its commands for.
void AP_LPVControl::measure(float *measured) const
{
    const AP_AHRS &ahrs = AP::ahrs();
    const Vector3f gyro = ahrs.get_gyro();
    Vector3f earth, body(NAN, NAN, NAN);
    float roll, pitch, yaw;
    ahrs.get_rotation_body_to_ned().to_euler(&roll, &pitch, &yaw);
    if (ahrs.get_velocity_NED(earth)) {
        body = ahrs.get_rotation_body_to_ned().mul_transpose(earth);
    }
    for (int i = 0; i < CONTROLLER_NU; i++) {
        measured[i] = NAN;
    }
#ifdef CONTROLLER_U_u
    measured[CONTROLLER_U_u] = body.x;
#endif
#ifdef CONTROLLER_U_v
    measured[CONTROLLER_U_v] = body.y;
#endif
#ifdef CONTROLLER_U_w
    measured[CONTROLLER_U_w] = body.z;
#endif
#ifdef CONTROLLER_U_p
    measured[CONTROLLER_U_p] = gyro.x;
#endif
#ifdef CONTROLLER_U_q
    measured[CONTROLLER_U_q] = gyro.y;
#endif
#ifdef CONTROLLER_U_r
    measured[CONTROLLER_U_r] = gyro.z;
#endif
#ifdef CONTROLLER_U_phi
    measured[CONTROLLER_U_phi] = roll;
#endif
#ifdef CONTROLLER_U_theta
    measured[CONTROLLER_U_theta] = pitch;
#endif
}

bool AP_LPVControl::update(const float *reference, const float *trim)
{
    const uint32_t now = AP_HAL::micros();
    if (_running && int32_t(now - _due_us) < 0) {
        return false;
    }
    float measured[CONTROLLER_NU], airspeed = 0.0f;
    const float elapsed = (now - _last_us) * 1e-6f;
    const bool known = AP::ahrs().airspeed_TAS(airspeed);
    measure(measured);
    _status = controller_update(&_controller, measured, reference, trim, nullptr, airspeed, known,
                                _command);
    // a reading that the controller does not follow, as one that is stuck, is none
    _hypotheses = monitor_update(&_monitor, airspeed, known && !(_status & CONTROLLER_PARAMETER),
                                 elapsed, _command);
    // a late sample does not make the next one early
    _due_us = _running && now - _due_us < PERIOD_US ? _due_us + PERIOD_US : now + PERIOD_US;
    _last_us = now;
    _running = true;
    return true;
}
