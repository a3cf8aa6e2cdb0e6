/*
 * effects/laws.h - the physical laws behind the effects as pure functions, each defined in the file of its effect, so
 * that each has a test of its own. SI units; radius is that of the sphere of equal volume.
 */
#ifndef CES_LAWS_H
#define CES_LAWS_H

#include "effect.h"

#define CES_VACUUM_PERMITTIVITY 8.8541878188e-12 /* F/m, CODATA 2022 */
#define CES_SPHERE_K_Q 1.6449340668482264        /* pi^2/6, charge of a sphere touching a plane over 4 pi eps0 r^2 E */
#define CES_SPHERE_K_F 1.3687235698262609        /* zeta(3) + 1/6, the force on it over 4 pi eps0 r^2 E^2 */
#define CES_MOST_SURFACE_CHARGE 26.6e-6          /* C/m2, above it air breaks down */

/* Charge of a conductor on a grounded plane in the normal field, C. */
double ces_contact_charge(double radius, double k_q, double field);

/* Charge at which an insulator in an ion flow stops collecting, C: 12 pi eps0 r^2 E eps_r/(eps_r + 2). */
double ces_pauthenier_charge(double radius, double permittivity, double field);

/* Charge at which the ellipsoid that stands for a grain saturates, over that of the sphere of equal volume. */
double ces_shape_saturation(const ces_Grain *grain);

/* The largest charge air allows on a sphere, C. */
double ces_breakdown_charge(double radius);

/* Charge a step later of a grain that an ion flow takes to saturation by Q(t) = Qs t/(t + time_constant), C. */
double ces_corona_charge(double charge, double saturation, double time_constant, double step);

/* Share of a turn from an angle, rad, that lies in an arc of [-pi, pi], and the middle of the longest piece of it there. */
double ces_share_in_arc(double angle, double turn, double from, double to, double *middle);

/* Charge a step later of a grain that conduction brings to rest in a decay time, C: rest + (Q - rest) exp(-step/tau). */
double ces_decayed_charge(double charge, double rest, double decay_time, double step);

/* Charge a step later under all that flows, C: dQ/dt = (Qs - Q)^2/(Qs ion_time) [while Q/Qs < 1] - (Q - rest)/decay_time. */
double ces_charge_after(double charge, const ces_ChargeFlow *flow, double step);

/* Charge of a conductor of this grain's shape on the drum as it lies there, C. k_q: nan, or the factor for all shapes. */
double ces_grain_contact_charge(const ces_Grain *grain, double k_q);

/* Sum over the principal axes (k) of values (k) (axis k . normal)^2: a factor of a shape as it lies. */
double ces_along_normal(const ces_Grain *grain, const double values[3]);

/* 1 - scatter U(0, 1), a grain's own number: what its charge is multiplied by. */
double ces_charge_scatter(uint64_t seed, uint64_t id, double scatter);

/* Pull of a plane on a charge at this distance from it, N, positive towards the plane. */
double ces_image_pull(double charge, double distance, double kappa);

/* Drag coefficients of a sphere; of a positive Reynolds number. */
double ces_drag_coefficient_stokes(double reynolds);
double ces_drag_coefficient_schiller_naumann(double reynolds);
/* Of a grain of any shape; reynolds with the diameter of the sphere of equal volume. */
double ces_drag_coefficient_haider_levenspiel(double reynolds, double sphericity);

/* The same over Stokes' 24/Re: finite at rest. */
double ces_drag_multiple_schiller_naumann(double reynolds);
double ces_drag_multiple_haider_levenspiel(double reynolds, double sphericity);

/* A drag coefficient's force over the weight at the end of the flight, an eighth of it: grains are slower on the way. */
double ces_drag_over_weight(const ces_EffectScale *scale, double coefficient, double air_density);

/* Lift on a spinning sphere over that of Rubinow & Keller, pi r^3 rho omega x v; spin: omega d/v. */
double ces_spin_lift_factor(double reynolds, double spin);

/* Wall stress over rho U^2/2 of a cylinder that turns in still air; reynolds: U R/nu. 0 below 100. */
double ces_rotating_cylinder_friction(double reynolds);

/* Velocity relative to a smooth wall over the friction velocity u; wall_distance: y u/nu. */
double ces_wall_law(double wall_distance);

/* Factors (a, b, c) of the force along the normal on a conducting sphere at a grounded plane,
 * F = a Q E - b Q^2/(4 pi eps0 r^2) + c 4 pi eps0 r^2 E^2, by the bispherical series; distance_over_radius > 1.
 * The work grows as the inverse square root of the gap. */
void ces_sphere_plane_series(double distance_over_radius, double factors[3]);

/* The same from the table in a state of ces_sphere_plane, at any distance; start() of that row
 * reads no def and no parameters. Below a gap of r/1000, as documented there, they are held. */
void ces_sphere_plane_factors(const void *state, double distance_over_radius, double factors[3]);

/* (eps_r - 1)/(eps_r + 2), of a conductor 1. */
double ces_polarisability(const ces_MaterialDef *material);

/* Pull between a sphere and a plane, N; hamaker in J. */
double ces_van_der_waals_pull(double hamaker, double radius, double distance);

/* What every size of an electric force is made of: eps0 E^2/(r rho g), the ratio of field pressure to weight. */
double ces_field_over_weight(const ces_EffectScale *scale);

#endif
