#pragma once

#include "stabilizer_types.h"

void controllerPidInit(void);
bool controllerPidTest(void);
void controllerPid(control_t *, const setpoint_t *, const sensorData_t *, const state_t *, const stabilizerStep_t);
