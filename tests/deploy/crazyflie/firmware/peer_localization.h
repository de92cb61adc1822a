#pragma once

#include "stabilizer_types.h"

typedef struct {
    uint8_t id;
    point_t pos; // its timestamp in ms
} peerLocalizationOtherPosition_t;

peerLocalizationOtherPosition_t *peerLocalizationGetPositionByID(uint8_t);
