/*
 * contact/detect.h - from where the grains are and would freely go, to the contacts of the step.
 *
 * A contact is taken in when the free paths meet, or pass nearer than the contacts of this very step may push the grains
 * aside: so nothing passes through, and nothing bounces off air.
 */
#ifndef CES_DETECT_H
#define CES_DETECT_H

#include "broad_phase.h"
#include "candidate.h"

typedef struct ces_Detector {
    ces_Grid grid;
    ces_Balls balls;
    ces_Pool boxes, reach, pair_counts, pair_candidates, surface_counts, surface_candidates;
} ces_Detector;

bool ces_detect(ces_Detector *detector, const ces_DetectInput *input,
                ces_Contacts *contacts); /* false: out of memory */
void ces_detector_free(ces_Detector *detector);

#endif
