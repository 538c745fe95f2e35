#pragma once
/* Declarations as ArduPilot's AP_HAL has them; no code of it. */
#include <stdint.h>

namespace AP_HAL {
uint32_t micros();
}
