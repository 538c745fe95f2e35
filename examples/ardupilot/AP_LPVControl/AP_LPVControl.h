#pragma once

/* A certified controller and the monitor of its hypotheses as an ArduPilot library: what symheli
   export controller and symheli export monitor write lies in this folder, without NAME_check.c.
   Not a flight controller: who calls it mixes the commands, and chooses when they are flown. */

#include <AP_Math/AP_Math.h>
#include <stdint.h>

#include "controller.h"
#include "monitor.h"

class AP_LPVControl {
public:
    AP_LPVControl() { init(); }

    // on the ground, at every call of the loop: nothing builds up
    void init();

    // switched on in flight: begin at the commands in force, CONTROLLER_NY blade pitches, rad
    void enter(const float *in_force);

    // at every call of the loop: true where a sample was due and the commands are new
    // reference: CONTROLLER_NU states of the trim; trim: CONTROLLER_NY blade pitches, rad
    bool update(const float *reference, const float *trim);

    // CONTROLLER_NY blade pitches, rad, held between two samples
    const float *command() const { return _command; }

    // bits of controller.h and of monitor.h at the last sample
    int status() const { return _status; }
    int hypotheses() const { return _hypotheses; }

    // all hypotheses of the certificate are met, and the controller met with nothing
    bool certified() const { return _hypotheses == MONITOR_MET && _status == 0; }

private:
    void measure(float *measured) const;

    controller_state _controller;
    monitor_state _monitor;
    float _command[CONTROLLER_NY];
    uint32_t _due_us, _last_us;
    int _status, _hypotheses;
    bool _running;
};
