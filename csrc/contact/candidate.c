#include "candidate.h"

#include <math.h>

/* A lasting touch is slower than this share of sqrt(g d), the speed of a fall through a diameter; so is what gathers in two steps. */
#define IMPACT_SPEED 0.1
#define IMPACT_STEPS 2.0

/* Normal velocities of a relative to b: at the start of the step, and by how much the free motion changes it. */
typedef struct Closing {
    double start, change; /* m/s */
    double path;          /* m */
} Closing;

/* Along the normal, at the start and at the end of the free step, of a grain's matter at the end of an arm. */
static void grain_speeds(const ces_DetectInput *input, const double n[3], size_t row, const double arm[3], double sign,
                         Closing *closing)
{
    closing->start += sign * ces_dot(n, &input->particles->velocity[3 * row]);
    closing->change += sign * ces_dot(n, &input->free_velocity[3 * row]);
    if (!input->only_spheres) { /* the arm of a sphere is along the normal */
        const double *spin = &input->particles->angular_velocity[3 * row];
        double lever[3];
        ces_cross(arm, n, lever);
        closing->start += sign * ces_dot(lever, spin);
        closing->change += sign * ces_dot(lever, input->free_spin != NULL ? &input->free_spin[3 * row] : spin);
    }
}

static Closing closing_of(const ces_DetectInput *input, const ces_Candidate *candidate, const ces_Contact *contact,
                          bool is_pair)
{
    const double *n = candidate->approach.normal;
    Closing closing = {.path = ces_dot(n, candidate->path)};
    grain_speeds(input, n, candidate->a, contact->arm_a, 1.0, &closing);
    if (is_pair) {
        grain_speeds(input, n, candidate->b, contact->arm_b, -1.0, &closing);
    } else if (input->surfaces[candidate->b].def.part >= 0) {
        const ces_Carriage *part = &input->surfaces[candidate->b].carriage;
        double before[3], after[3];
        ces_matter_velocity(&part->start, contact->arm_b, before);
        ces_matter_velocity(&part->end, contact->arm_b, after);
        closing.start -= ces_dot(n, before);
        closing.change -= ces_dot(n, after);
    } else {
        double shape[3];
        ces_surface_shape_velocity(&input->surfaces[candidate->b], candidate->point, shape);
        const double speed = ces_dot(n, shape);
        closing.start -= speed;
        closing.change -= speed;
    }
    closing.change -= closing.start;
    return closing;
}

/*
 * The velocity row of a contact, u_N + bias >= 0 (docs/numerics.md 1 in three cases):
 * a collision inside the step leaves with restitution times the speed of approach at the moment of touch;
 * an overlap asks for no approach, position correction does the rest;
 * everything else may close its gap within the step and no more.
 */
static void set_bias(const ces_DetectInput *input, const ces_Candidate *candidate, bool is_pair, double restitution,
                     double diameter, ces_Contact *contact)
{
    const ces_Approach *approach = &candidate->approach;
    const Closing closing = closing_of(input, candidate, contact, is_pair);
    const double at_touch = closing.start + approach->fraction * closing.change;
    const double lasting = ces_max(IMPACT_SPEED * sqrt(input->gravity * diameter), IMPACT_STEPS * fabs(closing.change));
    contact->impact = approach->hit && -at_touch > lasting;
    if (contact->impact) {
        const double after = -restitution * at_touch + (1.0 - approach->fraction) * closing.change;
        contact->bias = -ces_max(after, 0.0);
    } else if (approach->start_gap <= 0.0) {
        contact->bias = 0.0;
    } else {
        /* The gap must stay open along the free path and at the end velocity: the smaller of both counts. */
        const double gap_at_start = approach->gap - approach->fraction * closing.path;
        const double end_speed = closing.start + closing.change;
        contact->bias = gap_at_start / input->step + ces_min(0.0, closing.path / input->step - end_speed);
    }
}

/* From the centre of a grain, where it is at the fraction of its free path at which the contact is made. */
static void set_arm(const ces_DetectInput *input, size_t row, const ces_Candidate *candidate, double arm[3])
{
    for (size_t k = 0; k < 3; k++) {
        const double center =
            input->particles->position[3 * row + k] + candidate->approach.fraction * input->displacement[3 * row + k];
        arm[k] = candidate->point[k] - center;
    }
}

static void describe(const ces_DetectInput *input, const ces_Candidate *candidate, ces_Contact *contact)
{
    *contact = (ces_Contact){
        .id_a = input->particles->id[candidate->a],
        .a = candidate->a,
        .b = candidate->b,
        .carrier = CES_NO_PART,
        .part_a = candidate->part_a,
        .part_b = candidate->part_b,
        .gap = candidate->approach.start_gap,
        .fraction = candidate->approach.fraction,
    };
    ces_copy(candidate->approach.normal, contact->normal);
    ces_copy(candidate->point, contact->point);
    set_arm(input, candidate->a, candidate, contact->arm_a);
}

void ces_describe_pair(const ces_DetectInput *input, const ces_Candidate *candidate, size_t material_a,
                       size_t material_b, ces_Contact *contact)
{
    const ces_Particles *particles = input->particles;
    const size_t b = candidate->b;
    const size_t m = material_a * input->table->material_count + material_b;
    const double radius_a = candidate->radius_a, radius_b = candidate->radius_b;
    describe(input, candidate, contact);
    set_arm(input, b, candidate, contact->arm_b);
    /* The point is on a's surface; b is pushed at its own. */
    ces_add_scaled(contact->arm_b, -candidate->approach.gap, contact->normal);
    contact->id_b = particles->id[b];
    contact->friction = input->table->grain_friction[m];
    contact->rolling = input->table->grain_rolling[m];
    contact->spinning = input->table->grain_spinning[m];
    /* Rolling radius of a pair: r_a r_b / (r_a + r_b), the reduced radius (Ai et al., Powder Technol. 206 (2011) 269). */
    contact->ratio_a = radius_b / (radius_a + radius_b);
    contact->ratio_b = radius_a / (radius_a + radius_b);
    contact->rolling_radius = radius_a * contact->ratio_a;
    set_bias(input, candidate, true, input->table->grain_restitution[m], 2.0 * ces_min(radius_a, radius_b), contact);
}

/* Where the motion of b is prescribed, it is a number in the rows. */
static void describe_prescribed(const ces_Surface *surface, const ces_Candidate *candidate, ces_Contact *contact)
{
    const double *n = candidate->approach.normal;
    double matter[3], shape[3], spin[3];
    ces_surface_velocity(surface, contact->point, matter);
    ces_surface_shape_velocity(surface, contact->point, shape);
    /* A surface that moves in itself does so in its tangent plane; along the normal only the shape's own motion counts. */
    const double into = ces_dot(n, matter) - ces_dot(n, shape);
    for (int k = 0; k < 3; k++) {
        contact->surface[k] = matter[k] - into * n[k];
        spin[k] = candidate->radius_a * surface->spin[k];
    }
    ces_cross(spin, n, contact->surface_roll);
    contact->surface_spin = ces_dot(spin, n);
}

/* From the part's centre of mass. A cylinder's matter does not move along its normal when it turns about its axis: the point is
 * taken where the normal belongs, which may be that of the start of the path. */
static void set_part_arm(const ces_Surface *surface, const ces_Candidate *candidate, double arm[3])
{
    const ces_Carriage *part = &surface->carriage;
    const double fraction = candidate->approach.fraction;
    double from[3], radial[3], normal[3];
    for (int k = 0; k < 3; k++) {
        arm[k] = candidate->point[k] - part->start.position[k] -
                 fraction * (part->end.position[k] - part->start.position[k]);
        from[k] = candidate->point[k] - surface->center[k] - fraction * surface->displacement[k];
    }
    if (surface->def.shape != CES_CYLINDER) {
        return;
    }
    const double axis[3] = {surface->rotation[0][2], surface->rotation[1][2], surface->rotation[2][2]};
    ces_copy(from, radial);
    ces_copy(candidate->approach.normal, normal);
    ces_add_scaled(radial, -ces_dot(axis, from), axis);
    ces_add_scaled(normal, -ces_dot(axis, normal), axis);
    const double size = ces_norm(normal);
    if (size > 0.5) { /* on the side, not on a cap */
        ces_add_scaled(arm, -1.0, radial);
        ces_add_scaled(arm, ces_norm(radial) / size, normal);
    }
}

/* A dynamic part that yields is the other body; one that its joints hold altogether moves as they say. */
static void describe_part(const ces_Surface *surface, const ces_Candidate *candidate, ces_Contact *contact)
{
    const ces_Carriage *part = &surface->carriage;
    const double *n = candidate->approach.normal;
    double spin[3];
    set_part_arm(surface, candidate, contact->arm_b);
    for (int k = 0; k < 3; k++) {
        spin[k] = candidate->radius_a * part->end.spin[k];
    }
    if (part->yields) {
        contact->carrier = (uint32_t)surface->def.part;
        return;
    }
    ces_matter_velocity(&part->end, contact->arm_b, contact->surface);
    ces_cross(spin, n, contact->surface_roll);
    contact->surface_spin = ces_dot(spin, n);
}

void ces_describe_surface(const ces_DetectInput *input, const ces_Candidate *candidate, size_t material,
                          ces_Contact *contact)
{
    const ces_Surface *surface = &input->surfaces[candidate->b];
    const size_t m = (size_t)candidate->b * input->table->material_count + material;
    describe(input, candidate, contact);
    contact->id_b = -1 - (int64_t)candidate->b;
    contact->friction = input->table->surface_friction[m];
    contact->rolling = input->table->surface_rolling[m];
    contact->spinning = input->table->surface_spinning[m];
    contact->ratio_a = 1.0;
    contact->ratio_b = 0.0;
    contact->rolling_radius = candidate->radius_a;

    if (surface->def.part >= 0) {
        describe_part(surface, candidate, contact);
    } else {
        describe_prescribed(surface, candidate, contact);
    }
    set_bias(input, candidate, false, input->table->surface_restitution[m], 2.0 * candidate->radius_a, contact);
}
