// Ours, for builds on this machine: of the firmware's interface what the app uses, by the documentation. Fields by their public names.
#pragma once

#include <stdbool.h>
#include <stdint.h>

typedef uint32_t stabilizerStep_t; // of 1 kHz

typedef struct { float x, y, z; } Axis3f;
typedef struct { uint32_t timestamp; float roll, pitch, yaw; } attitude_t;
typedef struct { uint32_t timestamp; float x, y, z; } point_t;
typedef point_t velocity_t;
typedef point_t acc_t;
typedef point_t jerk_t;
typedef struct { float x, y, z, w; } quaternion_t;

typedef struct {
    Axis3f acc;  // g
    Axis3f gyro; // degrees/s
} sensorData_t;

typedef struct {
    attitude_t attitude; // degrees
    quaternion_t attitudeQuaternion;
    point_t position;    // m
    velocity_t velocity; // m/s
    acc_t acc;           // g
} state_t;

typedef enum { controlModeLegacy, controlModeForceTorque, controlModeForce } control_mode_t;

typedef struct {
    float thrustSi;  // N
    float torque[3]; // N m
    control_mode_t controlMode;
} control_t;

typedef enum { modeDisable, modeAbs, modeVelocity } stab_mode_t;

typedef struct {
    stab_mode_t x, y, z, roll, pitch, yaw, quat;
} setpoint_mode_t;

typedef struct {
    uint32_t timestamp;
    attitude_t attitude, attitudeRate;
    quaternion_t attitudeQuaternion;
    float thrust;
    point_t position;
    velocity_t velocity;
    acc_t acceleration;
    jerk_t jerk;
    bool velocity_body;
    setpoint_mode_t mode;
} setpoint_t;
