// Layers as one function: from what is measured and wanted to what each drone does.

#ifndef @GUARD@
#define @GUARD@

#include "colift.h"
#include "colift_team.h"

#define @PERIOD@_STEP @STEP@ // time from one step to the next, s

// Each drone may run a cascade of its own, and fly its own row: thrusts[i], torques[3 * i] to torques[3 * i + 2].
// A row a drone; what has a row more ends with the load's. Units and frames: colift's table of signals.
typedef struct {
    // Measured and wanted: yours to fill before each step. At first: as in the mission's first step.
@INPUTS@
    // What the layers make of it.
@INNER@
    int status; // of the allocator
    // Their memories.
@MEMORY@
} @NAME@;

void @NAME@_start(@NAME@ *c);

// Call the layers that are due at this step, which is counted from 0.
void @FUNCTION@(@NAME@ *c, int step);

#endif
