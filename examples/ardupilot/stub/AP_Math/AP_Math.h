#pragma once
/* Declarations as ArduPilot's AP_Math has them; no code of it. */
#include <math.h>

struct Vector3f {
    float x = 0, y = 0, z = 0;
    Vector3f() {}
    Vector3f(float a, float b, float c) : x(a), y(b), z(c) {}
};

struct Matrix3f {
    Vector3f a, b, c;
    void to_euler(float *roll, float *pitch, float *yaw) const;
    Vector3f mul_transpose(const Vector3f &v) const;
};
