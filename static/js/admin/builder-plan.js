// The structure of the study form: the JSON Schema of study files combined with the values in the text.
// New keys of the schema appear by themselves. Keys that the schema does not have stay in the YAML.

/** @typedef {(string | number)[]} Path */
/** @typedef {Record<string, any>} Schema */
/** @typedef {'group' | 'list' | 'map'} BlockKind */
/** @typedef {BlockKind | 'words' | 'text' | 'number' | 'switch' | 'choice' | 'names' | 'unknown'} Kind */
/**
 * @typedef {object} PlanNode
 * @property {Kind} kind
 * @property {Path} path
 * @property {string} label
 * @property {string} help
 * @property {boolean} required
 * @property {any} value as it is in the text; undefined if the key is missing
 * @property {any} initial the value that the server uses if the key is missing
 * @property {Schema} schema
 * @property {PlanNode[]} children
 * @property {string[]} options of a choice
 */

const UNITS = { min: 'minutes', s: 'seconds', ms: 'milliseconds' };
const TEXT = '#/$defs/Text';

/**
 * Return a schema with its references followed; what stands next to a reference counts.
 * @param {Schema} root
 * @param {Schema} schema
 * @returns {Schema}
 */
export function resolved(root, schema) {
  const { $ref, ...others } = schema;
  if ($ref === TEXT) return { ...others, isText: true };
  if ($ref) return { ...resolved(root, root.$defs[$ref.split('/').at(-1)]), ...others };
  const some = schema.anyOf?.filter((/** @type {Schema} */ one) => one.type !== 'null');
  if (some?.length === 1) {
    const { anyOf: _, ...rest } = schema;
    return { ...resolved(root, some[0]), ...rest, isOptional: true };
  }
  return schema;
}

/**
 * Of a block that can also be written as a list of names (the levels of a factor), the form that the value has.
 * @param {Schema} schema resolved
 * @param {any} value
 * @returns {Schema}
 */
function formOf(schema, value) {
  const map = schema.anyOf?.find((/** @type {Schema} */ one) => one.patternProperties);
  const names = schema.anyOf?.find((/** @type {Schema} */ one) => one.type === 'array');
  if (!map || !names) return schema;
  const { anyOf: _, ...rest } = schema;
  return { ...(Array.isArray(value) ? names : map), ...rest };
}

/**
 * @param {Schema} schema resolved
 * @returns {Kind}
 */
function kindOf(schema) {
  if (schema.isText) return 'words';
  if (schema.enum || schema.const !== undefined) return 'choice';
  if (schema.anyOf?.some((/** @type {Schema} */ one) => one.type === 'array')) return 'names';
  if (schema.oneOf || schema.properties) return 'group';
  if (schema.patternProperties || schema.additionalProperties) return 'map';
  if (schema.type === 'array') return isPlain(schema.items) ? 'names' : 'list';
  if (schema.type === 'integer' || schema.type === 'number') return 'number';
  if (schema.type === 'boolean') return 'switch';
  return schema.type === 'string' ? 'text' : 'unknown';
}

/** @param {Schema | undefined} items */
function isPlain(items) {
  return ['string', 'integer', 'number'].includes(items?.type ?? '');
}

/**
 * Lay a schema over a value.
 * @param {Schema} root
 * @param {Schema} given
 * @param {any} value
 * @param {Path} path
 * @param {boolean} required
 * @returns {PlanNode}
 */
export function planOf(root, given, value, path, required = false) {
  let schema = formOf(resolved(root, given), value);
  if (schema.oneOf) schema = variantOf(root, schema, value);
  let kind = kindOf(schema);
  if (String(path) === 'flow') kind = 'list'; // its order is what it says
  if (!fits(kind, value)) kind = 'unknown';
  const { title, unit } = labelOf(path);
  const node = {
    kind,
    path,
    label: unit ? `${title} (${unit})` : title,
    help: schema.description ?? '',
    required,
    value,
    initial: schema.default,
    schema,
    children: [],
    options: (schema.enum ?? []).map(String),
  };
  return { ...node, children: childrenOf(root, node) };
}

/**
 * @param {Kind} kind
 * @param {any} value
 */
function fits(kind, value) {
  if (value === undefined || value === null) return true;
  if (kind === 'group' || kind === 'map') return typeof value === 'object' && !Array.isArray(value);
  if (kind === 'list') return Array.isArray(value);
  if (kind === 'words') return !Array.isArray(value);
  if (kind === 'names') return typeof value === 'string' || (Array.isArray(value) && value.every(isWord));
  return typeof value !== 'object';
}

/** @param {any} value */
function isWord(value) {
  return typeof value === 'string' && !value.includes(',');
}

/**
 * The schema of a block that has several forms, such as a question: chosen by its `type`.
 * @param {Schema} root
 * @param {Schema} schema
 * @param {any} value
 * @returns {Schema}
 */
function variantOf(root, schema, value) {
  const { propertyName, mapping } = schema.discriminator;
  const chosen = mapping[value?.[propertyName]] ?? Object.values(mapping)[0];
  const variant = resolved(root, { $ref: chosen });
  const types = { title: 'Type', enum: Object.keys(mapping), type: 'string', description: variant.description };
  return { ...variant, properties: { [propertyName]: types, ...without(variant.properties, propertyName) } };
}

/**
 * @param {Record<string, any>} properties
 * @param {string} name
 */
function without(properties, name) {
  const { [name]: _, ...rest } = properties;
  return rest;
}

/**
 * @param {Schema} root
 * @param {PlanNode} node
 * @returns {PlanNode[]}
 */
function childrenOf(root, { kind, schema, value, path }) {
  if (kind === 'group') {
    if (schema.isOptional && (value === undefined || value === null)) return [];
    const required = schema.required ?? [];
    return Object.entries(schema.properties).map(([key, inner]) =>
      planOf(root, inner, value?.[key], [...path, key], required.includes(key)),
    );
  }
  if (kind === 'list') {
    return (value ?? []).map((/** @type {any} */ item, /** @type {number} */ index) =>
      planOf(root, schema.items, item, [...path, index], true),
    );
  }
  if (kind === 'map') {
    return Object.entries(value ?? {}).map(([key, item]) => planOf(root, innerOf(schema), item, [...path, key], true));
  }
  return [];
}

/**
 * The schema of the entries of a map.
 * @param {Schema} schema
 * @returns {Schema}
 */
export function innerOf(schema) {
  return schema.patternProperties ? Object.values(schema.patternProperties)[0] : schema.additionalProperties;
}

/**
 * "duration_min" -> Duration, minutes
 * @param {Path} path
 * @returns {{ title: string, unit: string }}
 */
function labelOf(path) {
  const words = String(path.at(-1)).split('_');
  const unit = /** @type {Record<string, string>} */ (UNITS)[words.length > 1 ? (words.at(-1) ?? '') : ''] ?? '';
  const title = (unit ? words.slice(0, -1) : words).join(' ');
  return { title: title.charAt(0).toUpperCase() + title.slice(1), unit };
}

/**
 * Return the initial value of a new item or block: its required keys.
 * @param {Schema} root
 * @param {Schema} given
 * @param {string[]} languages
 * @param {string} [variant] of a block with several forms
 * @returns {any}
 */
export function blank(root, given, languages, variant) {
  let schema = formOf(resolved(root, given), undefined);
  if (schema.oneOf) {
    const name = variant ?? Object.keys(schema.discriminator.mapping)[0];
    schema = variantOf(root, schema, { [schema.discriminator.propertyName]: name });
    const { properties, required } = schema;
    const rest = Object.fromEntries(
      required
        .filter((/** @type {string} */ key) => key !== 'type')
        .map((/** @type {string} */ key) => [key, properties[key]]),
    );
    return { ...ofEach(root, rest, languages), type: name };
  }
  if (schema.isText) return Object.fromEntries(languages.map((language) => [language, '']));
  if (schema.enum) return schema.enum[0];
  if (schema.const !== undefined) return schema.const;
  if (schema.type === 'array') {
    const { minItems = 0, items } = schema;
    return Array.from({ length: minItems }, (_, index) => withName(blank(root, items, languages), `new_${index + 1}`));
  }
  if (schema.properties) {
    const required = schema.required ?? [];
    const rest = Object.fromEntries(required.map((/** @type {string} */ key) => [key, schema.properties[key]]));
    return ofEach(root, rest, languages);
  }
  if (schema.type === 'integer' || schema.type === 'number') return schema.minimum ?? 1;
  if (schema.type === 'boolean') return schema.default ?? false;
  return schema.patternProperties || schema.additionalProperties ? {} : '';
}

/**
 * @param {Schema} root
 * @param {Record<string, Schema>} properties
 * @param {string[]} languages
 */
function ofEach(root, properties, languages) {
  return Object.fromEntries(Object.entries(properties).map(([key, inner]) => [key, blank(root, inner, languages)]));
}

/**
 * Give a new item this name, if it needs one.
 * @param {any} value
 * @param {string} name
 */
function withName(value, name) {
  const key = ['name', 'key', 'value'].find((one) => value?.[one] === '');
  return key ? { ...value, [key]: name } : value;
}

/**
 * Return the part of a plan that determines the form's elements: the form is rebuilt if it changes.
 * @param {PlanNode} node
 * @returns {any}
 */
export function shapeOf(node) {
  const words = node.kind === 'words' && node.value && typeof node.value === 'object' ? Object.keys(node.value) : '';
  const exists = node.schema.isOptional && node.kind === 'group' ? node.value !== undefined : '';
  return [node.kind, node.path.at(-1), words, exists, node.options.length, node.children.map(shapeOf)];
}
